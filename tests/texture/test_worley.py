import numpy as np
import pytest

from texbake.texture.procedures import evaluate
from texbake.texture.procedures.noise import lattice


def brute_force(points, jitter, seed, reach=4):
    """Distances to the two nearest points of all cells within `reach`, by the definition."""
    n_dimensions = points.shape[1]
    tables = lattice(seed)
    steps = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * n_dimensions), axis=-1)
    cells = np.floor(points)[:, None] + steps.reshape(-1, n_dimensions)
    index = np.zeros(cells.shape[:2], int)
    for axis in reversed(range(n_dimensions)):
        at = (cells[..., axis] + index) % 256
        # In the plane the chain begins with phi(j), as it does where phi(k) is 0.
        index = tables.permutation[at.astype(int)].astype(int)
    places = 0.5 + jitter * (tables.places[index, :n_dimensions] - 0.5)
    distances = np.linalg.norm(cells + places - points[:, None], axis=2)
    return np.sort(distances, axis=1)[:, :2].T


@pytest.mark.parametrize("n_dimensions", [2, 3])
@pytest.mark.parametrize("jitter", [1.0, 0.4, 0.0])
def test_it_finds_the_two_nearest_of_all_points(n_dimensions, jitter):
    points = np.random.default_rng(0).uniform(-300, 300, (800, n_dimensions))
    nearest, second = brute_force(points, jitter, seed=6)
    parameters = {"jitter": jitter, "seed": 6}
    f1 = evaluate("worley", points, parameters=parameters)[:, 0]
    border = evaluate("worley", points, parameters=parameters | {"feature": "f2-f1"})[:, 0]
    np.testing.assert_allclose(f1, np.minimum(nearest, 1.0), atol=1e-6)
    np.testing.assert_allclose(border, np.minimum(second - nearest, 1.0), atol=1e-6)


def test_without_jitter_points_are_the_middles_of_cells():
    points = np.random.default_rng(0).uniform(-9, 9, (500, 3))
    expected = np.linalg.norm(points - np.floor(points) - 0.5, axis=1)
    found = evaluate("worley", points, parameters={"jitter": 0.0})[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_it_is_continuous_across_cells():
    rng = np.random.default_rng(0)
    before = rng.uniform(-9, 9, (3000, 3))
    before[:, 0] = np.floor(before[:, 0])
    step = np.array([1e-9, 0.0, 0.0])
    for feature in ("f1", "f2-f1"):
        sides = [
            evaluate("worley", before + side, parameters={"feature": feature})
            for side in (step, -step)
        ]
        # A distance changes by at most the way; float32 rounding of values up to 1.
        np.testing.assert_allclose(*sides, atol=2e-7)


@pytest.mark.parametrize("feature", ["f1", "f2-f1"])
@pytest.mark.parametrize("n_dimensions", [2, 3])
def test_wide_pixels_are_the_mean(feature, n_dimensions):
    points = np.random.default_rng(1).uniform(-200, 200, (40_000, n_dimensions))
    parameters = {"feature": feature}
    plain = evaluate("worley", points, parameters=parameters)
    wide = evaluate("worley", points, np.full(len(points), 5.0), parameters=parameters)
    assert np.ptp(wide) == 0.0
    # Means of 40,000 and of 16,384 points with deviations up to 0.2: 0.002 each; three of them.
    assert wide[0, 0] == pytest.approx(plain.mean(), abs=0.006)


def test_far_out_it_is_the_same_pattern():
    points = np.random.default_rng(0).integers(-500, 500, (300, 3)) / 16.0
    here = evaluate("worley", points)
    np.testing.assert_array_equal(evaluate("worley", points + 256.0 * 4_000_000), here)
    np.testing.assert_array_equal(evaluate("worley", points - 256.0 * 4_000_000), here)
