import math

import numpy as np
import pytest

from texbake import Light, Lighting, Material, OptionError
from texbake.rendering.effects.lights import arriving_light, fix_in_world, placed_light

WHITE = Material(shading="lambert", base_color=(1.0, 1.0, 1.0))
CLOSE = {"rtol": 5e-6, "atol": 1e-8}  # float32 light


def toward(position, points):
    """Unit vectors from points to a position, and the distances."""
    offsets = np.asarray(position) - points
    distances = np.linalg.norm(offsets, axis=-1, keepdims=True)
    return offsets / distances, distances


@pytest.mark.parametrize("size", [0.0, 1e-200, 1e160, math.inf, math.nan])
def test_a_direction_needs_a_length_whose_square_is_a_number(size):
    with pytest.raises(OptionError, match=r"sun\.direction: .* is not a direction"):
        Light(name="sun", direction=(size, 0.0, 0.0))
    Light(name="bulb", kind="point", direction=(size, 0.0, 0.0))


@pytest.mark.parametrize("decay", [2.0, 1.0, 0.0])
def test_a_point_light_falls_with_the_distance(wall, decay):
    light = Light(
        kind="point", position=(0.4, -0.3, 0.7), color=(1.0, 0.5, 0.2), intensity=3.0, decay=decay
    )
    found = wall.light(WHITE, Lighting(lights=(light,)))
    directions, distances = toward(light.position, wall.points)
    # I_L / d^decay (N·L), and N·L = z / d.
    expected = 3.0 * np.array(light.color) * directions[..., 2:] / distances**decay
    np.testing.assert_allclose(found, expected, **CLOSE)


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_a_spot_fades_between_its_inner_and_outer_cone(wall, blend):
    goes = np.array((0.1, 0.2, -1.0))
    light = Light(
        kind="spot", position=(0.0, 0.0, 1.5), direction=tuple(4 * goes), angle=50.0, blend=blend
    )
    found = wall.light(WHITE, Lighting(lights=(light,)))[..., 0]
    directions, distances = toward(light.position, wall.points)
    full = (directions[..., 2:] / distances**2)[..., 0]
    cosine = -directions @ goes / np.linalg.norm(goes)
    outer, inner = math.cos(math.radians(25)), math.cos(math.radians(25 * (1 - blend)))
    t = np.clip((cosine - outer) / max(inner - outer, 1e-300), 0.0, 1.0)
    share = np.where(cosine <= outer, 0.0, t * t * (3 - 2 * t))
    np.testing.assert_allclose(found, full * share, rtol=2e-5, atol=1e-8)
    assert not found[cosine <= outer].any() and (cosine <= outer).sum() > 50
    inside = cosine >= inner
    if blend < 1.0:
        assert inside.sum() > 5
        np.testing.assert_allclose(found[inside], full[inside], **CLOSE)


def test_a_light_that_follows_the_camera_is_the_same_from_everywhere(wall):
    axes = wall.camera.axes
    for kind in "directional", "spot", "point":
        follows = Light(
            kind=kind, position=(0.1, 0.2, 0.3), direction=(0.2, -0.1, -1.0), angle=60.0,
            follows_camera=True,
        )  # fmt: skip
        stands = fix_in_world(follows, wall.camera)
        np.testing.assert_allclose(
            stands.position, wall.camera.eye + axes.T @ (0.1, 0.2, 0.3), rtol=1e-12
        )
        assert not stands.follows_camera and fix_in_world(stands, wall.camera) is stands
        one, other = (wall.light(WHITE, Lighting(lights=(light,))) for light in (follows, stands))
        np.testing.assert_allclose(one, other, rtol=1e-6)
        assert one.max() > 0.1


def test_lights_add_up_and_dark_ones_add_nothing(wall):
    lights = (
        Light(direction=(0.1, 0.2, -1.0), color=(0.2, 0.3, 0.4)),
        Light(kind="point", position=(1.0, 0.0, 1.0)),
        Light(kind="spot", position=(0.0, 1.0, 2.0), direction=(0.0, 0.0, -1.0)),
    )
    dark = (Light(intensity=0.0), Light(color=(0.0, 0.0, 0.0)))
    together = wall.light(WHITE, Lighting(lights=(*lights, *dark)))
    each = sum(wall.light(WHITE, Lighting(lights=(light,))) for light in lights)
    np.testing.assert_allclose(together, each, rtol=1e-6)


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_light_in_the_surface_is_bright_there_and_finite(kind):
    light = placed_light(Light(kind=kind, direction=(0, 0, -1), position=(1.0, 2.0, 3.0)))
    points = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0 - 1e-5], [1.0, 2.0, 2.0]])
    found = arriving_light(light, points, np.array([[0.0, 0.0, 1.0]] * 3, np.float32))
    # From along the normal, as strong as at a thousandth of a unit; there it stays.
    np.testing.assert_allclose(found.directions, [[0, 0, 1]] * 3)
    np.testing.assert_allclose(found.radiance[:, 0], [1e6, 1e6, 1.0], rtol=1e-6)
    # So far off that the square of the distance is infinite: dark.
    far = arriving_light(light, np.full((1, 3), 1e200), np.array([[0.0, 0.0, 1.0]], np.float32))
    assert not far.radiance.any() and np.isfinite(far.directions).all()
