import numpy as np
import pytest

from texbake import Mesh, OptionError, UnwrapOptions, distortion, unwrap
from texbake.errors import UvError
from texbake.mapping.options.projection import WARPS
from texbake.mapping.transform import bulge, power, scale_to_density, transform_uvs, twirl, warp_uvs
from texbake.mesh.shapes import icosphere, plane

POINTS = np.random.default_rng(5).random((40, 3, 2)) * 3 - 1


def test_default_options_change_no_bit():
    assert np.array_equal(transform_uvs(POINTS, UnwrapOptions()), POINTS)


@pytest.mark.parametrize(("changes", "expected"), [
    ({"flip": "s"}, (0.75, 0.5)),
    ({"flip": "t"}, (0.25, 0.5)),
    ({"flip": "st"}, (0.75, 0.5)),
    ({"rotate": 90}, (0.5, 0.25)),
    ({"rotate": 180}, (0.75, 0.5)),
    ({"rotate": -90}, (0.5, 0.75)),
    ({"scale": 4}, (1.0, 2.0)),
    ({"scale": (2, -1)}, (0.5, -0.5)),
    ({"flip": "s", "rotate": 90, "scale": 2}, (1.0, 1.5)),  # in this order
])  # fmt: skip
def test_each_step_and_their_order(changes, expected):
    point = np.array([[0.25, 0.5]])
    assert transform_uvs(point, UnwrapOptions(**changes)).tolist() == [list(expected)]  # type: ignore[arg-type, call-overload]


@pytest.mark.parametrize("degrees", [30.0, 90.0, 180.0, -135.0])
def test_a_rotation_turns_counter_clockwise_about_the_middle(degrees):
    before, after = (
        (points - 0.5) @ [1.0, 1.0j]
        for points in (POINTS, transform_uvs(POINTS, UnwrapOptions(rotate=degrees)))
    )
    assert after == pytest.approx(before * np.exp(1j * np.radians(degrees)), abs=1e-14)


@pytest.mark.parametrize("size", [1024, (2048, 256)])
@pytest.mark.parametrize("method", ["planar", "atlas"])
def test_the_mesh_has_the_requested_texel_density(size, method):
    options = UnwrapOptions(method=method, size=size, texel_density=90.0)
    mesh = plane(4, 4) if method == "planar" else icosphere(2)
    assert distortion(unwrap(mesh, options), size).texel_density == pytest.approx(90.0, rel=1e-3)


def test_no_area_has_no_density():
    line = Mesh(positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]])
    with pytest.raises(UvError, match="no area"):
        scale_to_density(line, np.zeros((1, 3, 2)), UnwrapOptions(texel_density=1.0))


def test_an_offset_is_added_last():
    mesh = plane(2, 2)
    moved = unwrap(mesh, method="parametric", scale=3.0, offset=(1.0, -2.0))
    assert moved.corner_uvs() == pytest.approx(mesh.corner_uvs() * 3.0 + [1.0, -2.0])


GRID = np.stack(np.meshgrid(np.linspace(0, 1, 81), np.linspace(0, 1, 81)), axis=-1).reshape(-1, 2)


def jacobians(warp, step=1e-6):
    """Determinants by central differences."""
    ds, dt = ((warp(GRID + e) - warp(GRID - e)) / (2 * step) for e in step * np.eye(2))
    return ds[:, 0] * dt[:, 1] - ds[:, 1] * dt[:, 0]


@pytest.mark.parametrize("degrees", [90.0, -200.0])
def test_a_twirl_turns_the_middle_and_keeps_areas(degrees):
    near = np.array([[0.5 + 1e-9, 0.5]])
    turned = (twirl(near, degrees) - 0.5) / 1e-9
    angle = np.radians(degrees)
    assert turned == pytest.approx(np.array([[np.cos(angle), np.sin(angle)]]), abs=1e-6)
    # Points move on circles, by an angle that only their radius sets: areas stay. At the radius 1/2
    # the second derivative jumps, which costs differences over 1e-6 as much.
    assert jacobians(lambda p: twirl(p, degrees)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("strength", [0.99, 0.5, -0.5, -1.24])
def test_a_bulge_scales_the_middle_and_never_folds(strength):
    near = np.array([[0.5, 0.5 + 1e-9]])
    assert (bulge(near, strength) - 0.5)[0, 1] / 1e-9 == pytest.approx(1 - strength, rel=1e-6)
    assert (jacobians(lambda p: bulge(p, strength)) > 0).all()


@pytest.mark.parametrize("warp", [lambda p: twirl(p, 200.0), lambda p: bulge(p, -1.0)])
def test_round_warps_keep_points_outside_bit_for_bit(warp):
    outside = GRID[np.hypot(*(GRID - 0.5).T) >= 0.5]
    assert len(outside) > 1000 and np.array_equal(warp(outside), outside)


def test_a_power_works_within_each_tile():
    points = np.array([[0.25, -1.5], [2.25, 1.0]])
    assert power(points, 2.0) == pytest.approx(np.array([[0.0625, -1.75], [2.0625, 1.0]]))
    assert np.array_equal(power(GRID, 1.0), GRID)


def test_names_have_strengths():
    for name, strength in WARPS.items():
        assert np.array_equal(warp_uvs(GRID, name), warp_uvs(GRID, (name, strength)))
        assert not np.array_equal(warp_uvs(GRID, name), GRID)


def test_a_function_is_called_with_a_copy():
    before = GRID.copy()

    def shifted(points):
        points += 1.0
        return points

    assert np.array_equal(warp_uvs(GRID, shifted), before + 1.0)
    assert np.array_equal(GRID, before)


@pytest.mark.parametrize(("function", "message"), [
    (lambda p: p[:-1], "must return"),
    (lambda p: None, "must return"),
    (lambda p: "twirl", "must return"),
    (lambda p: p * np.nan, "not finite"),
])  # fmt: skip
def test_a_function_that_returns_something_else_is_one_error(function, message):
    with pytest.raises(OptionError, match=message):
        warp_uvs(GRID, function)
