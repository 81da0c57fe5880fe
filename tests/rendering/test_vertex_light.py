"""Shading per vertex: the light of corners, interpolated, against closed forms."""

import math

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Environment, Light, Lighting
from texbake.rendering.scene.material import BumpMap, Material, NormalMap, Reflection
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture

OPTIONS = RenderOptions(width=60, height=60, supersampling=1)
CAMERA = Camera.looking_at((0.5, 0.4, 2.0), (0.5, 0.5, 0.0), fov=math.radians(25), near=0.01)
LAMP = Light(kind="point", position=(0.3, 0.6, 0.5), decay=2.0)
QUARTERS = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 0]]], np.float32)
TEXTURE = ImageTexture(image=QUARTERS, filter="nearest")


def picture(mesh, lighting=None, **material):
    item = SceneObject(mesh=mesh, material=Material(**material))
    scene = Scene(objects=(item,), lighting=lighting or Lighting(lights=(LAMP,)))
    return draw(prepare(scene, OPTIONS), CAMERA).color[..., :3]


def unit_square_points():
    """(60, 60, 2): x and y where the middles of pixels see the plane z = 0."""
    rays = pixel_rays(CAMERA, 60, 60)
    return np.asarray((CAMERA.eye - CAMERA.eye[2] / rays[..., 2:] * rays)[..., :2])


def lambert_at(points):
    """(...,): light of the lamp that a white plane z = 0 reflects at points (..., 2)."""
    way = np.asarray(LAMP.position) - np.concatenate(
        [points, np.zeros((*points.shape[:-1], 1))], -1
    )
    distance = np.linalg.norm(way, axis=-1)
    return np.asarray(way[..., 2] / distance**3)


@pytest.mark.parametrize("base", [(1.0, 1.0, 1.0), (0.2, 0.5, 0.9), TEXTURE], ids=str)
def test_the_light_of_three_corners_is_interpolated_and_the_base_color_is_not(base):
    at = unit_square_points()
    x, y = np.moveaxis(at, -1, 0)
    lit = {
        corner: lambert_at(np.array(corner, float)) for corner in ((0, 0), (1, 0), (0, 1), (1, 1))
    }
    # The plane is split along its rising diagonal.
    lower = lit[0, 0] + x * (lit[1, 0] - lit[0, 0]) + y * (lit[1, 1] - lit[1, 0])
    upper = lit[0, 0] + y * (lit[0, 1] - lit[0, 0]) + x * (lit[1, 1] - lit[0, 1])
    light = np.where(y < x, lower, upper)
    color = (
        np.asarray(base)
        if isinstance(base, tuple)
        else QUARTERS[(y < 0.5).astype(int), (x > 0.5).astype(int)]
    )
    inside = ((at > 0.01) & (at < 0.99)).all(axis=-1)
    far = (np.abs(at - 0.5).min(axis=-1) > 1e-6) & (np.abs(x - y) > 1e-4)
    found = picture(plane(), shading="lambert", shading_rate="vertex", base_color=base)
    expected = light[..., None] * color
    np.testing.assert_allclose(found[inside & far], expected[inside & far], atol=1e-6)
    assert inside.sum() > 1500
    by_pixel = picture(plane(), shading="lambert", base_color=base)
    assert np.abs(by_pixel - found)[inside].max() > 0.5  # the lamp is near the middle


@pytest.mark.parametrize("shading", ["lambert", "blinn-phong", "metallic-roughness"])
@pytest.mark.parametrize("metalness", [0.0, 1.0])
def test_small_triangles_come_to_look_as_shaded_per_pixel(shading, metalness):
    material = {"shading": shading, "metalness": metalness, "base_color": (0.9, 0.5, 0.2)}
    light = Lighting(
        lights=(LAMP,), ambient=Ambient(color=(0.2, 0.1, 0.1), ground=(0.0, 0.1, 0.3)),
        environment=Environment(color=(0.3, 0.3, 0.4), lighting=True, background=False),
    )  # fmt: skip
    errors = []
    for n in (8, 16, 32):
        by_vertex, by_pixel = (
            picture(plane(n, n), light, shading_rate=rate, **material)
            for rate in ("vertex", "pixel")
        )
        errors.append(float(np.abs(by_vertex - by_pixel).max()))
    # Of second order: half the edge, a quarter of the error.
    assert errors[1] < 0.4 * errors[0] and errors[2] < 0.4 * errors[1]


def test_bumps_between_the_corners_do_not_show():
    heights = np.zeros((64, 64, 1), np.float32)
    heights[16:48, 16:48] = 1.0
    bumps = BumpMap(texture=ImageTexture(image=heights), height=0.05)
    flat, bumpy, by_pixel = (
        picture(plane(), shading="lambert", shading_rate=rate, bump_map=bump_map)
        for rate, bump_map in (("vertex", None), ("vertex", bumps), ("pixel", bumps))
    )
    np.testing.assert_array_equal(flat, bumpy)
    smooth = picture(plane(), shading="lambert")
    assert np.abs(by_pixel - smooth).max() > 0.1


def test_a_normal_map_is_looked_up_at_the_corners():
    tilted = np.array([0.6, 0.0, 0.8], np.float32)
    texels = np.tile(tilted, (4, 4, 1)).astype(np.float32)
    sun = Lighting(lights=(Light(direction=(-0.6, 0.0, -0.8)),))
    holder = NormalMap(texture=ImageTexture(image=texels), space="tangent", convention="opengl")
    found = picture(
        plane(), sun, shading="lambert", shading_rate="vertex", base_color=(1.0, 1.0, 1.0),
        normal_map=holder,
    )  # fmt: skip
    assert found.max() == pytest.approx(1.0, abs=1e-3)


def test_solid_bumps_tilt_the_normals_of_corners():
    """A ramp in space has the same slope at corners and at pixels."""
    ends = {"start": -1.0, "end": 2.0, "direction": (1.0, 0.0, 0.0)}
    ramp = ProcedureTexture(procedure="gradient", parameters=ends)
    sun = Lighting(lights=(Light(direction=(-0.6, 0.2, -1.0)),))
    flat, pixels, corners = (
        picture(plane(2, 2), sun, shading="lambert", bump_map=bump, shading_rate=rate)
        for bump, rate in (
            (None, "pixel"),
            (BumpMap(texture=ramp, height=0.9), "pixel"),
            (BumpMap(texture=ramp, height=0.9), "vertex"),
        )
    )
    middle = slice(20, 40), slice(20, 40)
    assert np.abs(pixels - flat)[middle].min() > 0.05
    np.testing.assert_allclose(corners[middle], pixels[middle], atol=2e-3)


def test_light_that_is_the_same_from_all_sides_is_computed_at_pixels():
    even = Lighting(ambient=Ambient(color=(0.2, 0.4, 0.6)))
    item = SceneObject(mesh=plane(), material=Material(shading="lambert", shading_rate="vertex"))
    plan = plan_of(prepare(Scene(objects=(item,), lighting=even), OPTIONS), CAMERA)
    assert not plan.has("vertex light")
    found = picture(plane(), even, shading="lambert", shading_rate="vertex")
    np.testing.assert_array_equal(found, picture(plane(), even, shading="lambert"))


def test_mirrors_and_kept_normals_stay_per_pixel():
    around = np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
    sky = Lighting(lights=(LAMP,), environment=Environment(image=around))
    mirror = {"reflection": Reflection(), "shading": "lambert"}
    found, expected = (
        picture(uv_sphere(8, 8), sky, shading_rate=rate, **mirror) for rate in ("vertex", "pixel")
    )
    np.testing.assert_array_equal(found, expected)
    scene = Scene(
        objects=(SceneObject(mesh=plane(), material=Material(shading_rate="vertex")),),
        lighting=Lighting(lights=(LAMP,)),
    )
    frame = draw(prepare(scene, OPTIONS), CAMERA, keep=("normals",))
    np.testing.assert_allclose(frame.normals[30, 30], (0.0, 0.0, 1.0), atol=1e-6)
