"""Value noise against another computation, and how smooth its four interpolations are."""

from itertools import product

import numpy as np
import pytest

from texbake.texture.procedures import evaluate
from texbake.texture.procedures.noise import lattice

SEED = 5
SHARES = {
    "none": lambda t: 0.0 * t,
    "linear": lambda t: t,
    "cubic": lambda t: 3 * t**2 - 2 * t**3,
    "quintic": lambda t: 6 * t**5 - 15 * t**4 + 10 * t**3,
}


def value_noise(points, interpolation, footprint=None):
    parameters = {"interpolation": interpolation, "seed": SEED}
    return evaluate("value_noise", points, footprint, parameters=parameters)[:, 0]


def expected(points, interpolation):
    """Sum over the eight corners of the products of their shares."""
    tables = lattice(SEED)
    phi, numbers = tables.permutation.astype(int), tables.places[:, 0]
    cells = np.floor(points).astype(int)
    shares = SHARES[interpolation](points - cells)
    total = np.zeros(len(points))
    for corner in product((0, 1), repeat=3):
        i, j, k = ((cells + corner) % 256).T
        weights = np.where(corner, shares, 1.0 - shares).prod(axis=1)
        total += weights * numbers[phi[i + phi[j + phi[k]]]]
    return total


@pytest.mark.parametrize("interpolation", SHARES)
def test_the_values_of_eight_corners_are_interpolated(interpolation):
    points = np.random.default_rng(1).uniform(-300, 300, (5000, 3))
    found = value_noise(points, interpolation)
    np.testing.assert_allclose(found, expected(points, interpolation), atol=1e-7)
    assert found.min() >= 0.0 and found.max() <= 1.0
    assert abs(float(found.mean()) - 0.5) < 0.03


@pytest.mark.parametrize(
    ("interpolation", "jumps"), [("none", 0), ("linear", 1), ("cubic", 2), ("quintic", 3)]
)
def test_the_first_derivative_that_jumps_at_the_lattice(interpolation, jumps):
    """Differences from both sides of a lattice plane, divided by the step."""
    step = 2e-3
    rest = np.random.default_rng(2).uniform(0, 256, (200, 2))
    at = [
        np.column_stack([np.full(200, 7.0 + offset), rest])
        for offset in (-3 * step, -2 * step, -step, -1e-9, 0.0, step, 2 * step, 3 * step)
    ]
    values = [expected(points, interpolation) for points in at]
    for points, value in zip(at, values, strict=True):
        np.testing.assert_allclose(value_noise(points, interpolation), value, atol=1e-7)
    left, right = values[:4], values[4:]
    orders = [
        np.abs(np.diff(left, n, axis=0)[-1] - np.diff(right, n, axis=0)[0]).max() / step**n
        for n in range(jumps + 1)
    ]
    assert orders[jumps] > 0.5
    assert all(order < 0.5 for order in orders[:jumps])


def test_detail_finer_than_a_pixel_fades_to_the_mean():
    points = np.random.default_rng(3).uniform(0, 99, (100, 3))
    np.testing.assert_array_equal(value_noise(points, "none", np.full(100, 2.0)), 0.5)
    exact = value_noise(points, "none", np.full(100, 0.1))
    np.testing.assert_array_equal(exact, value_noise(points, "none"))
