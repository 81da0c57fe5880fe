import math
from dataclasses import replace

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, AmbientOcclusion, Environment, Light, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture

SKY, GROUND = np.array((0.2, 0.5, 0.9)), np.array((0.4, 0.1, 0.05))
BASE = np.array((0.3, 0.6, 0.9))
CLOSE = {"rtol": 1e-6, "atol": 1e-7}  # float32 light


def everywhere(value):
    return np.broadcast_to(value, (16, 24, 3))


@pytest.mark.parametrize("shading", ["lambert", "blinn-phong", "metallic-roughness"])
def test_ambient_light_is_the_base_color_times_it(wall, shading):
    material = Material(shading=shading, base_color=tuple(BASE), metalness=0.7)
    found = wall.light(material, Lighting(ambient=Ambient(color=tuple(SKY))))
    np.testing.assert_allclose(found, everywhere(BASE * SKY), **CLOSE)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.8])
def test_a_hemisphere_is_weighted_by_how_far_the_normal_points_up(wall, up, tilt):
    normal = np.array((0.3, tilt, 1.0)) / math.sqrt(1.09 + tilt**2)
    found = wall.light(
        Material(shading="lambert", base_color=tuple(BASE)),
        Lighting(ambient=Ambient(color=tuple(SKY), ground=tuple(GROUND))),
        normal=normal,
        options=replace(wall.options, up=up),
    )
    above = 0.5 + 0.5 * normal[1 if up == "y" else 2]
    np.testing.assert_allclose(
        found, everywhere(BASE * (above * SKY + (1 - above) * GROUND)), **CLOSE
    )


@pytest.mark.parametrize("metalness", [None, 0.25])
def test_a_light_map_is_scattered_by_the_dull_part(wall, metalness):
    rng = np.random.default_rng(1)
    texels = rng.random((5, 7, 3)).astype(np.float32)
    material = Material(
        shading="lambert" if metalness is None else "metallic-roughness", base_color=tuple(BASE),
        metalness=metalness or 0.0, light_map=ImageTexture(image=texels, filter="nearest"),
    )  # fmt: skip
    found = wall.light(material)
    columns = np.floor(wall.uvs[..., 0] * 7).astype(int)
    rows = np.floor((1 - wall.uvs[..., 1]) * 5).astype(int)
    expected = texels[rows, columns] * BASE * (1 - (metalness or 0.0))
    np.testing.assert_allclose(found, expected, **CLOSE)


@pytest.mark.parametrize("strength", [1.0, 0.5, 0.0])
def test_an_occlusion_map_holds_back_light_from_everywhere_alone(wall, strength):
    material = Material(
        shading="lambert", base_color=tuple(BASE), occlusion=0.3, occlusion_strength=strength,
        emission=(0.1, 0.1, 0.1), light_map=0.5,
    )  # fmt: skip
    found = wall.light(material, Lighting(ambient=Ambient(color=tuple(SKY))))
    share = 1 + strength * (0.3 - 1)
    np.testing.assert_allclose(found, everywhere(BASE * (share * SKY + 0.5) + 0.1), **CLOSE)


WHITE = Material(shading="lambert", base_color=(1.0, 1.0, 1.0))
EVERYWHERE = Ambient(color=(1.0, 1.0, 1.0))


def lighting(**occlusion):
    return Lighting(ambient=EVERYWHERE, occlusion=AmbientOcclusion(**occlusion))


@pytest.mark.parametrize("samples", [1, 16, 200])
@pytest.mark.parametrize("radius", [None, 0.3, 50.0])
def test_a_plane_alone_has_none(wall, samples, radius):
    # Exactly: nothing rises above it, and what arrives is divided by all that there is.
    found = wall.light(WHITE, lighting(samples=samples, radius=radius))
    np.testing.assert_array_equal(found, 1.0)


def test_a_plane_at_a_grazing_angle_has_none_either():
    mesh = Mesh(
        positions=[[-50, 0, -400], [50, 0, -400], [50, 0, 2], [-50, 0, 2]],
        faces=[[0, 2, 1], [0, 3, 2]],
    )
    camera = Camera.looking_at((0, 0.5, 0), (0, 0.3, -10), fov=1.0, near=1e-3)
    options = RenderOptions(width=80, height=60, supersampling=1)
    scene = Scene(objects=(SceneObject(mesh=mesh, material=WHITE),), lighting=lighting(radius=3.0))
    frame = draw(prepare(scene, options), camera)
    seen = frame.coverage == 1
    assert seen.sum() > 2000
    np.testing.assert_array_equal(frame.color[seen], 1.0)


def corner(camera, options, **occlusion):
    """Floor y = 0 and wall x = 0 that meet along z."""
    mesh = Mesh(
        positions=[[0, 0, -9], [0, 0, 9], [9, 0, 9], [9, 0, -9], [0, 9, -9], [0, 9, 9]],
        faces=[[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]],
    )  # fmt: skip
    scene = Scene(objects=(SceneObject(mesh=mesh, material=WHITE),), lighting=lighting(**occlusion))
    return draw(prepare(scene, options), camera)


def test_an_inner_corner_approaches_one_half():
    # At the edge a quarter of the sphere is open; weighted by the cosine, half of all light.
    options = RenderOptions(width=200, height=300, supersampling=1)
    camera = Camera.looking_at((3.0, 3.0, 0.0), (0, 0, 0), fov=1.1, near=0.01)
    frame = corner(camera, options, radius=2.0, samples=400)
    middle, on_wall = frame.color[:, 100, 0], frame.face_ids[:, 100] >= 2
    origin, right, down = camera.view_rays(200, 300)
    assert (frame.coverage == 1).all()
    # Pixels beside the edge: within their own width of it the corner looks infinitely large.
    edge = np.flatnonzero(np.diff(on_wall))[0]
    near = middle[edge - 3 : edge + 5]
    assert near.min() > 0.45 and near.max() < 0.6
    rays = origin + 100.5 * right + (np.arange(300) + 0.5)[:, None] * down
    reach = np.where(on_wall, 3.0 / -rays[:, 0], 3.0 / -rays[:, 1])
    points = camera.eye + reach[:, None] * rays
    away = np.hypot(points[:, 0], points[:, 1])
    # Nothing is held back beyond the radius, but for the pixels that the mean reaches over.
    assert (middle[away > 2.05] == 1.0).all() and (away > 2.05).sum() > 20
    # Of a wall at the distance d, what lies within r of the point hides (m - (d/r)^2 tan m) / pi,
    # cos m = d/r. It counts in full up to half the radius and fades to nothing at all of it.
    for distance in 0.1, 0.3, 0.5:
        at = np.abs(away - distance).argmin()
        low, high = (1 - hidden_within(reach, distance) for reach in (2.0, 1.0))
        # Slices and steps are finite: 14 and 15 of them.
        assert low - 0.02 < middle[at] < high + 0.02, distance


def hidden_within(reach, distance):
    m = math.acos(distance / reach)
    return (m - (distance / reach) ** 2 * math.tan(m)) / math.pi


def test_strength_mixes_and_lamps_are_not_held_back():
    options = RenderOptions(width=90, height=60, supersampling=1)
    camera = Camera.looking_at((3.0, 3.0, 0.0), (0, 0, 0), fov=0.6, near=0.01)
    full, half = (
        corner(camera, options, radius=2.0, strength=s).color[..., 0].astype(float)
        for s in (1.0, 0.5)
    )
    np.testing.assert_allclose(half, 1 - 0.5 * (1 - full), atol=1e-6)
    assert full.min() < 0.6


def test_only_light_from_everywhere_is_held_back():
    options = RenderOptions(width=60, height=60, supersampling=1)
    camera = Camera.looking_at((2.0, 2.0, 2.0), (0, 0, 0), fov=0.8, near=0.01)
    sky = Environment(color=(1.0,) * 3, lighting=True, background=False)
    sun = Light(direction=(-1, -2, -3))
    floor = Mesh(positions=[[-3, -0.5, -3], [-3, -0.5, 3], [3, -0.5, 3]], faces=[[0, 1, 2]])

    def seen(**fields):
        fields = {"lights": (sun,), "occlusion": AmbientOcclusion(radius=1.0)} | fields
        objects = (
            SceneObject(mesh=cube(), material=WHITE),
            SceneObject(mesh=floor, material=WHITE),
        )
        scene = Scene(objects=objects, lighting=Lighting(**fields))
        return draw(prepare(scene, options), camera).color[..., :3].astype(float)

    sun_alone = seen()
    ambient, environment = seen(ambient=EVERYWHERE), seen(environment=sky)
    ground = seen(ambient=Ambient(color=(0, 0, 0), ground=(1, 1, 1)))
    plain = seen(ambient=EVERYWHERE, occlusion=None)
    held = (plain - ambient)[..., 0]
    assert held.max() > 0.2 and held.min() >= -1e-6
    # The sky of 1 is the ambient light of 1; the ground alone is held back too.
    np.testing.assert_allclose(environment, ambient, atol=1e-4)
    assert (ground - sun_alone).max() > 0.1
    np.testing.assert_array_equal(seen(occlusion=None), sun_alone)
    assert np.isfinite(ambient).all()
