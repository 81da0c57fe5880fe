from __future__ import annotations

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mapping.options.transform import WARPS
from texbake.mapping.warp import bulge, power, twirl, warped

GRID = np.stack(np.meshgrid(np.linspace(0, 1, 81), np.linspace(0, 1, 81)), axis=-1).reshape(-1, 2)


def jacobians(warp, step: float = 1e-6) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Determinants by central differences."""
    ds, dt = ((warp(GRID + e) - warp(GRID - e)) / (2 * step) for e in step * np.eye(2))
    return ds[:, 0] * dt[:, 1] - ds[:, 1] * dt[:, 0]


@pytest.mark.parametrize("degrees", [90.0, -200.0])
def test_a_twirl_turns_the_middle_and_keeps_areas(degrees: float) -> None:
    near = np.array([[0.5 + 1e-9, 0.5]])
    turned = (twirl(near, degrees) - 0.5) / 1e-9
    angle = np.radians(degrees)
    assert turned == pytest.approx(np.array([[np.cos(angle), np.sin(angle)]]), abs=1e-6)
    # Points move on circles, by an angle that only their radius sets: areas stay. At the radius 1/2
    # the second derivative jumps, which costs differences over 1e-6 as much.
    assert jacobians(lambda p: twirl(p, degrees)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("strength", [0.99, 0.5, -0.5, -1.24])
def test_a_bulge_scales_the_middle_and_never_folds(strength: float) -> None:
    near = np.array([[0.5, 0.5 + 1e-9]])
    assert (bulge(near, strength) - 0.5)[0, 1] / 1e-9 == pytest.approx(1 - strength, rel=1e-6)
    assert (jacobians(lambda p: bulge(p, strength)) > 0).all()


@pytest.mark.parametrize("warp", [lambda p: twirl(p, 200.0), lambda p: bulge(p, -1.0)])
def test_round_warps_leave_what_is_outside_bit_for_bit(warp) -> None:  # type: ignore[no-untyped-def]
    outside = GRID[np.hypot(*(GRID - 0.5).T) >= 0.5]
    assert len(outside) > 1000
    assert np.array_equal(warp(outside), outside)


def test_a_power_works_within_each_tile() -> None:
    points = np.array([[0.25, -1.5], [2.25, 1.0]])
    assert power(points, 2.0) == pytest.approx(np.array([[0.0625, -1.75], [2.0625, 1.0]]))
    assert np.array_equal(power(GRID, 1.0), GRID)


def test_names_have_strengths() -> None:
    for name, strength in WARPS.items():
        assert np.array_equal(warped(GRID, name), warped(GRID, (name, strength)))
        assert not np.array_equal(warped(GRID, name), GRID)


def test_a_function_is_called_with_a_copy() -> None:
    before = GRID.copy()

    def shifted(points: np.ndarray) -> np.ndarray:
        points += 1.0
        return points

    assert np.array_equal(warped(GRID, shifted), before + 1.0)
    assert np.array_equal(GRID, before)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda p: p[:-1], "must return"),
        (lambda p: None, "must return"),
        (lambda p: "twirl", "must return"),
        (lambda p: p * np.nan, "not finite"),
    ],
)
def test_a_function_that_returns_something_else_is_one_error(function, message) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(OptionError, match=message):
        warped(GRID, function)
