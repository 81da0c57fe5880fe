import math

import numpy as np
import pytest

from texbake.core import core
from texbake.mesh.mesh import Mesh
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Environment, Fog, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject

BASE, GRAY = np.array((0.9, 0.4, 0.1)), np.array((0.3, 0.5, 0.6))


@pytest.mark.parametrize(
    ("fog", "left"),
    [
        (Fog(color=tuple(GRAY), mode="exp", density=0.3), lambda d: np.exp(-0.3 * d)),
        (Fog(color=tuple(GRAY), mode="exp2", density=0.3), lambda d: np.exp(-((0.3 * d) ** 2))),
        (
            Fog(color=tuple(GRAY), mode="linear", start=2.2, end=3.0),
            lambda d: np.clip((3.0 - d) / 0.8, 0, 1),
        ),
    ],
)
def test_light_fades_with_the_distance_from_the_eye(wall, fog, left):
    found = wall.light(Material(shading="unlit", base_color=tuple(BASE)), Lighting(fog=fog))
    share = left(wall.distances)[..., None]
    np.testing.assert_allclose(found, share * BASE + (1 - share) * GRAY, rtol=1e-6)
    assert np.ptp(share) > 0.1


def left_after(distance, mode, density, start, end):
    light = np.ones((1, 3), np.float32)
    place = np.array([[0.0, distance, 0.0]])
    core.fade_into_fog(place, np.zeros(3), mode, density, start, end, np.zeros(3), light)
    assert (light == light[0, 0]).all()
    return light[0, 0]


def test_what_is_left_at_known_distances():
    assert left_after(2.0, 1, 0.5, 0.0, 0.0) == np.float32(math.exp(-1.0))
    assert left_after(2.0, 2, 0.5, 0.0, 0.0) == np.float32(math.exp(-1.0))
    assert left_after(1.0, 2, 0.5, 0.0, 0.0) == np.float32(math.exp(-0.25))
    assert [left_after(d, 0, 0.0, 2.0, 6.0) for d in (0, 2, 3, 6, 99)] == [1, 1, 0.75, 0, 0]
    assert left_after(math.inf, 1, 0.1, 0.0, 0.0) == 0.0


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


def test_fog_without_density_is_none():
    thin, sky = Fog(color=tuple(GRAY), density=0.0), Environment(color=(1.0, 0.0, 0.0))
    np.testing.assert_array_equal(corner_of(small_scene(fog=thin, environment=sky)), [1, 0, 0, 1])
    np.testing.assert_array_equal(corner_of(small_scene(fog=thin)), corner_of(small_scene()))
