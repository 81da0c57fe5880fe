import math

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
        positions=[
            [0, 0, -9], [0, 0, 9], [9, 0, 9], [9, 0, -9], [0, 9, -9], [0, 9, 9],
        ],
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
