"""Gradient, value and Worley noise and their octaves, against definitions in plain Python."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.texture.procedures import evaluate
from texbake.texture.procedures.noise import WEIGHTS, _SplitMix64, fractal_sum, gradients, lattice

BOTH = pytest.mark.parametrize("weight", ["cubic", "quintic"])


def random_points(n, seed=0, size=300.0):
    return np.random.default_rng(seed).uniform(-size, size, (n, 3))


def signed_noise(points, footprint=None, **parameters):
    return fractal_sum(points, footprint, octaves=1, **parameters)


def turbulence_sum(points, footprint=None, **parameters):
    """The sum that turbulence shows, where it is not clamped."""
    size = WEIGHTS["cubic"].bound * sum(0.25**i for i in range(parameters.get("octaves", 6))) ** 0.5
    return size * evaluate("turbulence", points, footprint, parameters=parameters)[:, 0]


def by_definition(point, weight, seed):
    """Sum over corners of w(u) w(v) w(t) (G . (u, v, t)), one number at a time."""
    phi = [int(number) for number in lattice(seed).permutation[:256]]
    slopes = gradients(weight, seed).tolist()

    def falloff(t):
        t = abs(t)
        if weight == "cubic":
            return 2 * t**3 - 3 * t**2 + 1
        return 1 - (6 * t**5 - 15 * t**4 + 10 * t**3)

    total = 0.0
    for step in product((0, 1), repeat=3):
        i, j, k = (math.floor(c) + s for c, s in zip(point, step, strict=True))
        off = [c - corner for c, corner in zip(point, (i, j, k), strict=True)]
        index = phi[(i + phi[(j + phi[k % 256]) % 256]) % 256]
        slope = sum(g * o for g, o in zip(slopes[index], off, strict=True))
        total += math.prod(map(falloff, off)) * slope
    return total


@BOTH
@settings(max_examples=60)
@given(point=st.tuples(*[st.floats(-(2.0**50), 2.0**50)] * 3), seed=st.integers(-5, 2**70))
def test_it_is_the_formula(weight, point, seed):
    # Terms of a weight are up to 15 and cancel: 4e-15 of rounding in each of three factors of
    # slopes up to 2.5, in the sum here and in the definition.
    expected = by_definition(point, weight, seed)
    assert signed_noise([point], weight=weight, seed=seed)[0] == pytest.approx(expected, abs=6e-14)


@BOTH
def test_bounds_mean_and_variance(weight):
    values = np.concatenate(
        [signed_noise(random_points(60_000, seed), weight=weight, seed=seed) for seed in range(8)]
    )
    known = WEIGHTS[weight]
    assert np.abs(values).max() <= known.bound and np.abs(values).max() > 0.7 * known.bound
    # Eight seeds lie within 3 sigma / sqrt(8) of the mean over seeds: 1 to 2 percent of it.
    assert (values**2).mean() == pytest.approx(known.variance[1], rel=0.03)
    assert np.abs(values).mean() == pytest.approx(known.size[1], rel=0.02)
    # About 5e5 samples of deviation 0.18 or 0.27, and gradients that do not sum to 0 exactly.
    assert abs(values.mean()) < 0.003


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -(2.0**51)])
def test_coordinates_that_are_not_finite_count_as_0(odd):
    points = random_points(50)
    for axis in range(3):
        with_odd, with_0 = points.copy(), points.copy()
        with_odd[:, axis], with_0[:, axis] = odd, 0.0
        np.testing.assert_array_equal(signed_noise(with_odd), signed_noise(with_0))


def test_the_generator_gives_the_published_numbers():
    random = _SplitMix64(1234567)
    assert [random._next() for _ in range(3)] == [
        6457827717110365317, 3203168211198807973, 9817491932198370423,
    ]  # fmt: skip


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-50.0, 50.0, (20_000, 3))


def test_fractal_and_turbulence_are_their_sums(points):
    shift = np.array([37, 17, 59])
    expected = sum(signed_noise(points * 2.0**i + i * shift, seed=5) / 2.0**i for i in range(6))
    np.testing.assert_allclose(fractal_sum(points, seed=5), expected, atol=1e-15)
    expected = signed_noise(points) + 0.7 * signed_noise(points * 1.9 + shift)
    found = fractal_sum(points, octaves=2, lacunarity=1.9, gain=0.7)
    np.testing.assert_allclose(found, expected, atol=1e-15)
    expected = sum(np.abs(signed_noise(points * 2.0**i, seed=5)) / 2.0**i for i in range(6))
    np.testing.assert_allclose(turbulence_sum(points, seed=5), expected, atol=1e-6)


@pytest.mark.parametrize("weight", ["cubic", "quintic"])
def test_values_of_octaves_are_the_sums_scaled_to_0_and_1(points, weight):
    bound = WEIGHTS[weight].bound
    size = bound * sum(0.25**i for i in range(6)) ** 0.5
    pairs = [
        ("noise", 0.5 + signed_noise(points, weight=weight) / (2 * bound)),
        ("fractal", 0.5 + fractal_sum(points, weight=weight) / (2 * size)),
    ]
    for name, expected in pairs:
        found = evaluate(name, points, parameters={"weight": weight})
        np.testing.assert_allclose(found[:, 0], np.clip(expected, 0, 1), atol=1e-7)


def test_octaves_keep_a_quarter_cell_per_pixel_and_fade_to_the_mean_at_one(points):
    np.testing.assert_array_equal(
        signed_noise(points, np.full(len(points), 0.25)), signed_noise(points)
    )
    assert (signed_noise(points, np.ones(len(points))) == 0.0).all()
    size = WEIGHTS["cubic"].size[1]
    faded = turbulence_sum(points, np.full(len(points), np.inf), octaves=3)
    np.testing.assert_allclose(faded, size * 1.75, rtol=1e-6)


def test_octaves_fade_from_the_finest(points):
    """In a pixel of half a unit the octaves of 1/2 unit and finer are gone; the others are not."""
    width = np.full(len(points), 0.5)
    kept = 1.0 - (lambda t: t * t * (3.0 - 2.0 * t))((0.5 - 0.25) / 0.75)
    np.testing.assert_allclose(fractal_sum(points, width), kept * signed_noise(points), atol=1e-15)


@pytest.mark.parametrize("n_columns", [2, 3])
@pytest.mark.parametrize("weight", ["cubic", "quintic"])
@pytest.mark.parametrize("name", ["noise", "fractal", "turbulence"])
def test_means_of_octaves_do_not_change_with_the_pixel(points, name, weight, n_columns):
    plain = evaluate(name, points[:, :n_columns], parameters={"weight": weight}).mean()
    for width in (0.1, 0.5, 10.0):
        filtered = evaluate(
            name, points[:, :n_columns], np.full(len(points), width), parameters={"weight": weight}
        ).mean()
        # One seed differs from the mean of all by up to 5 percent of a mean of 0.3, in the plane.
        assert filtered == pytest.approx(plain, abs=0.015)


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
def test_worley_finds_the_two_nearest_of_all_points(n_dimensions, jitter):
    points = np.random.default_rng(0).uniform(-300, 300, (800, n_dimensions))
    nearest, second = brute_force(points, jitter, seed=6)
    parameters = {"jitter": jitter, "seed": 6}
    f1 = evaluate("worley", points, parameters=parameters)[:, 0]
    border = evaluate("worley", points, parameters=parameters | {"feature": "f2-f1"})[:, 0]
    np.testing.assert_allclose(f1, np.minimum(nearest, 1.0), atol=1e-6)
    np.testing.assert_allclose(border, np.minimum(second - nearest, 1.0), atol=1e-6)


@pytest.mark.parametrize("feature", ["f1", "f2-f1"])
@pytest.mark.parametrize("n_dimensions", [2, 3])
def test_worley_wide_pixels_are_the_mean(feature, n_dimensions):
    points = np.random.default_rng(1).uniform(-200, 200, (40_000, n_dimensions))
    parameters = {"feature": feature}
    plain = evaluate("worley", points, parameters=parameters)
    wide = evaluate("worley", points, np.full(len(points), 5.0), parameters=parameters)
    assert np.ptp(wide) == 0.0
    # Means of 40,000 and of 16,384 points with deviations up to 0.2: 0.002 each; three of them.
    assert wide[0, 0] == pytest.approx(plain.mean(), abs=0.006)


def test_two_coordinates_are_the_plane_z_0():
    points = random_points(200)
    points[:, 2] = 0.0
    np.testing.assert_array_equal(signed_noise(points), signed_noise(points[:, :2]))


def test_tables_are_permutations_and_unit_gradients():
    tables = lattice(3)
    np.testing.assert_array_equal(np.sort(tables.permutation[:256]), np.arange(256))
    np.testing.assert_array_equal(tables.permutation[256:], tables.permutation[:256])
    np.testing.assert_allclose(np.linalg.norm(tables.sphere, axis=1), 1.0, rtol=1e-15)
    assert {tuple(sorted(map(abs, row))) for row in tables.edges.tolist()} == {(0.0, 1.0, 1.0)}
    assert len(np.unique(tables.edges, axis=0)) == 12
    assert tables.places.min() >= 0.0 and tables.places.max() < 1.0
    # 256 unit vectors even over the sphere: their mean is about 1 / 16 long.
    assert np.linalg.norm(tables.sphere.mean(axis=0)) < 0.2


SEED = 5
SHARES = {
    "none": lambda t: 0.0 * t, "linear": lambda t: t, "cubic": lambda t: 3 * t**2 - 2 * t**3,
    "quintic": lambda t: 6 * t**5 - 15 * t**4 + 10 * t**3,
}  # fmt: skip


def values_of(points, interpolation, footprint=None):
    parameters = {"interpolation": interpolation, "seed": SEED}
    return evaluate("value_noise", points, footprint, parameters=parameters)[:, 0]


def by_corners(points, interpolation):
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
    found = values_of(points, interpolation)
    np.testing.assert_allclose(found, by_corners(points, interpolation), atol=1e-7)
    assert found.min() >= 0.0 and found.max() <= 1.0
    assert abs(float(found.mean()) - 0.5) < 0.03


def test_detail_finer_than_a_pixel_fades_to_the_mean():
    points = np.random.default_rng(3).uniform(0, 99, (100, 3))
    np.testing.assert_array_equal(values_of(points, "none", np.full(100, 2.0)), 0.5)
    exact = values_of(points, "none", np.full(100, 0.1))
    np.testing.assert_array_equal(exact, values_of(points, "none"))
