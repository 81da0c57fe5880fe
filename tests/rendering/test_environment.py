import math
from dataclasses import replace

import numpy as np
import pytest

from texbake import Lighting, Material, Mesh, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effects.environment import turn_of
from texbake.rendering.scene.lights import Environment, Fog

# A color for each face: +x, -x, +y, -y, +z, -z.
COLORS = np.array([(1, 0, 0), (0, 1, 1), (0, 1, 0), (1, 0, 1), (0, 0, 1), (1, 1, 0)], np.float32)


def six_faces(size=8):
    return tuple(np.broadcast_to(color, (size, size, 3)).copy() for color in COLORS)


def looking(direction, up=(0, 1, 0)):
    return Camera.looking_at((0, 0, 0), direction, up=up, fov=math.radians(30), near=0.01)


def behind(environment, direction, **options):
    """Background beside a tiny, distant sphere, at the center of the picture's left half."""
    options = RenderOptions(width=16, height=16, supersampling=1, **options)
    mesh = uv_sphere(4, 8)
    far = SceneObject(mesh=mesh.replace(positions=mesh.positions * 1e-3 + (50, 50, 50)))
    scene = Scene(objects=(far,), lighting=Lighting(environment=environment))
    up = (0, 1, 0) if abs(direction[1]) < 0.9 else (0, 0, 1)
    return draw(prepare(scene, options), looking(direction, up)).color


@pytest.mark.parametrize("face", range(6))
def test_each_face_of_a_cube_is_seen_where_it_looks(face):
    direction = np.zeros(3)
    direction[face // 2] = 1.0 - 2.0 * (face % 2)
    found = behind(Environment(faces=six_faces()), direction)
    np.testing.assert_array_equal(found[..., :3], np.broadcast_to(COLORS[face], (16, 16, 3)))


def test_a_latitude_longitude_image_has_minus_z_in_its_middle_and_plus_x_on_the_right():
    image = np.zeros((64, 128, 3), np.float32)
    image[:, 64:] = (1, 0, 0)  # right half: +x
    image[:16] += (0, 1, 0)  # the upper quarter of the heights
    environment = Environment(image=image, size=32)
    ahead = behind(environment, (0, 0, -1))
    assert (ahead[:, :6, 0] < 0.1).all() and (ahead[:, 10:, 0] > 0.9).all()
    assert behind(environment, (0, 1, 0.01))[..., 1].min() > 0.9
    assert behind(environment, (0, -1, 0.01))[..., 1].max() < 0.1
    # Turned by 90 degrees about the up axis, what was ahead is at one side.
    turned = behind(replace(environment, rotate=90.0), (-1, 0, 0))
    other = behind(replace(environment, rotate=-90.0), (1, 0, 0))
    np.testing.assert_allclose(turned, ahead, atol=1e-5)
    np.testing.assert_allclose(other, ahead, atol=1e-5)


def test_the_turn_takes_the_worlds_up_to_the_images():
    for up, axis in ("y", (0, 1, 0)), ("z", (0, 0, 1)):
        for rotate in 0.0, 30.0:
            turn = turn_of(Environment(rotate=rotate), up)
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
            assert np.linalg.det(turn) == pytest.approx(1.0)
            np.testing.assert_allclose(turn @ axis, (0, 1, 0), atol=1e-15)
    # Where z is up, the front (-y, as of `view`) takes the place of +z.
    np.testing.assert_allclose(turn_of(Environment(), "z") @ (0, -1, 0), (0, 0, 1), atol=1e-15)


def test_intensity_scales_and_the_background_can_be_left_out():
    sky = Environment(color=(0.2, 0.4, 0.6))
    np.testing.assert_allclose(
        behind(replace(sky, intensity=2.5), (1, 2, 3))[..., :3],
        np.broadcast_to((0.5, 1.0, 1.5), (16, 16, 3)), rtol=1e-6,
    )  # fmt: skip
    hidden = behind(replace(sky, background=False), (1, 2, 3), background=(1.0, 0.0, 0.0))
    np.testing.assert_array_equal(hidden[0, 0], (1, 0, 0, 1))


def furnace(wall, **material):
    """Light of a material in an environment of 1 all around, relative to it."""
    everywhere = Environment(color=(1.0, 1.0, 1.0), lighting=True)
    found = wall.light(Material(**material), Lighting(environment=everywhere))
    assert np.ptp(found, axis=-1).max() < 1e-6
    return found[..., 0]


@pytest.mark.parametrize("shading", ["lambert", "blinn-phong"])
def test_a_white_furnace_lights_white_to_white(wall, shading):
    found = furnace(wall, shading=shading, base_color=(1.0, 1.0, 1.0))
    # Float32 texels, summed with weights that sum to 1 within their rounding.
    np.testing.assert_allclose(found, 1.0, rtol=1e-5)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.7, 1.0])
def test_a_white_dielectric_gives_back_all_light(wall, roughness):
    # What is not mirrored is scattered: m + (1 - m) = 1, whatever the table of the split sum says,
    # so no energy is lost but by rounding of the filtered levels.
    found = furnace(wall, base_color=(1.0, 1.0, 1.0), roughness=roughness)
    np.testing.assert_allclose(found, 1.0, rtol=1e-4)


def albedo_of_metal(roughness, cosine):
    """Share that microfacets of F = 1 reflect once, by midpoints: that of D V (N·L), x 4 / 4."""
    alpha = roughness**2
    n = 800
    theta = (np.arange(n) + 0.5) / n * np.pi / 2
    phi = (np.arange(2 * n) + 0.5) / (2 * n) * 2 * np.pi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    light = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)
    eye = np.array([math.sqrt(1 - cosine**2), 0.0, cosine])
    half = light + eye
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    d = alpha**2 / (np.pi * (half[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    nl = np.cos(t)
    v = 0.5 / (
        nl * math.sqrt(cosine**2 * (1 - alpha**2) + alpha**2)
        + cosine * np.sqrt(nl**2 * (1 - alpha**2) + alpha**2)
    )
    return float((d * v * nl * np.sin(t)).sum() * (np.pi / 2 / n) * (np.pi / n))


@pytest.mark.parametrize("roughness", [0.4, 0.7, 1.0])
def test_a_white_metal_loses_what_microfacets_pass_on_to_one_another(wall, roughness):
    # F = 1: what is missing to 1 is the light that a second facet would reflect, which the model
    # leaves out: known, and up to half at grazing angles of rough metals.
    found = furnace(wall, base_color=(1.0, 1.0, 1.0), metalness=1.0, roughness=roughness)
    for place in (8, 12), (0, 0), (15, 23), (3, 20):
        expected = albedo_of_metal(roughness, wall.to_eye[place][2])
        # A table of 64 x 64 that is interpolated, from 512 samples a texel.
        assert found[place] == pytest.approx(expected, abs=4e-3)
    if roughness == 1.0:
        assert found.max() < 0.9


def test_a_smooth_metal_mirrors_and_a_rough_one_gathers(wall):
    faces = six_faces()
    sky = Environment(faces=faces, lighting=True)
    metal = {"base_color": (1.0, 1.0, 1.0), "metalness": 1.0}
    smooth = wall.light(Material(roughness=0.0, **metal), Lighting(environment=sky))
    mirrored = 2 * wall.to_eye[..., 2:] * (0, 0, 1) - wall.to_eye
    largest = np.abs(mirrored).argmax(axis=-1)
    sign = np.take_along_axis(mirrored, largest[..., None], -1)[..., 0] < 0
    sure = np.sort(np.abs(mirrored), axis=-1)
    sure = sure[..., 2] - sure[..., 1] > 0.3
    assert sure.sum() > 100
    np.testing.assert_allclose(smooth[sure], COLORS[2 * largest + sign][sure], atol=0.03)
    # By the normal (0, 0, 1) alone: mostly the face +z, a little of the four beside it.
    dull = wall.light(Material(shading="lambert", base_color=(1.0,) * 3), Lighting(environment=sky))
    np.testing.assert_allclose(dull, np.broadcast_to(dull[0, 0], dull.shape), rtol=1e-5)
    # The cosine-weighted share of the face z = 1, |x|, |y| <= 1: (4 / pi) atan(1/sqrt 2) / sqrt 2.
    share = 4 / math.pi * math.atan(1 / math.sqrt(2)) / math.sqrt(2)
    side = (1 - share) / 4
    expected = share * COLORS[4] + side * COLORS[:4].sum(axis=0)
    # Second-order spherical harmonics or small faces: within 3 %.
    np.testing.assert_allclose(dull[0, 0], expected, atol=0.03)


def test_occlusion_of_the_material_holds_back_the_environment(wall):
    sky = Lighting(environment=Environment(color=(0.5, 0.5, 0.5), lighting=True))
    full = wall.light(Material(roughness=0.6), sky)
    held = wall.light(Material(roughness=0.6, occlusion=0.25), sky)
    np.testing.assert_allclose(held, 0.25 * full, rtol=1e-5)


# Fog.
BASE, GRAY = np.array((0.9, 0.4, 0.1)), np.array((0.3, 0.5, 0.6))


@pytest.mark.parametrize(("fog", "left"), [
    (Fog(color=tuple(GRAY), mode="exp", density=0.3), lambda d: np.exp(-0.3 * d)),
    (Fog(color=tuple(GRAY), mode="exp2", density=0.3), lambda d: np.exp(-((0.3 * d) ** 2))),
    (Fog(color=tuple(GRAY), mode="linear", start=2.2, end=3.0),
     lambda d: np.clip((3.0 - d) / 0.8, 0, 1)),
])  # fmt: skip
def test_light_fades_with_the_distance_from_the_eye(wall, fog, left):
    found = wall.light(Material(shading="unlit", base_color=tuple(BASE)), Lighting(fog=fog))
    share = left(wall.distances)[..., None]
    np.testing.assert_allclose(found, share * BASE + (1 - share) * GRAY, rtol=1e-6)
    assert np.ptp(share) > 0.1


def small_scene(**lighting):
    mesh = Mesh(positions=[[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    return Scene(
        objects=(SceneObject(mesh=mesh, material=Material(shading="unlit")),),
        lighting=Lighting(**lighting),
    )


def corner_of(scene, **options):
    options = RenderOptions(width=32, height=32, supersampling=1, **options)
    camera = Camera.looking_at((0, 0, 4.0), (0, 0, 0.0), fov=1.0, near=0.01)
    frame = draw(prepare(scene, options), camera)
    assert frame.coverage[0, 0] == 0
    return frame.color[0, 0]


def test_infinitely_far_behind_there_is_only_fog():
    fog, sky = Fog(color=tuple(GRAY), density=0.01), Environment(color=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(corner_of(small_scene(fog=fog))[:3], GRAY, rtol=1e-6)
    np.testing.assert_allclose(
        corner_of(small_scene(fog=fog, environment=sky))[:3], GRAY, rtol=1e-6
    )
