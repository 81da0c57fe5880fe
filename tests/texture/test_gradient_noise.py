"""Noise held against its definition in plain Python, and against what follows from it."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.texture.procedures import signed_noise
from texbake.texture.procedures.noise import WEIGHTS, _SplitMix64, gradients, lattice

BOTH = pytest.mark.parametrize("weight", ["cubic", "quintic"])


def random_points(n, seed=0, size=300.0):
    return np.random.default_rng(seed).uniform(-size, size, (n, 3))


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
@settings(max_examples=60, deadline=None)
@given(
    point=st.tuples(*[st.floats(-1e5, 1e5)] * 3),
    seed=st.integers(-5, 2**70),
)
def test_it_is_the_formula(weight, point, seed):
    # Terms of a weight are up to 15 and cancel: 4e-15 of rounding in each of three factors of
    # slopes up to 2.5, in the sum here and in the definition.
    expected = by_definition(point, weight, seed)
    assert signed_noise([point], weight=weight, seed=seed)[0] == pytest.approx(expected, abs=6e-14)


@BOTH
def test_it_is_0_at_lattice_points(weight):
    corners = np.random.default_rng(0).integers(-(10**9), 10**9, (2000, 3)).astype(float)
    assert (signed_noise(corners, weight=weight) == 0.0).all()


@BOTH
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_how_smooth_it_is_at_planes_of_the_lattice(weight, axis):
    """Along an axis it is a polynomial in each cell: fitted exactly, its derivatives compared."""
    degree = 4 if weight == "cubic" else 6
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    places = np.random.default_rng(1).uniform(0.2, 0.8, (50, 3)) + 7.0
    sides = []
    for offset in (-1.0, 0.0):
        points = np.repeat(places[:, None], degree + 1, axis=1)
        points[:, :, axis] = 8.0 + offset + nodes
        values = signed_noise(points.reshape(-1, 3), weight=weight).reshape(len(places), -1)
        powers = np.polynomial.polynomial.polyfit(offset + nodes, values.T, degree)
        sides.append(powers[:3])  # value, slope and half the curvature at the plane
    jumps = np.abs(sides[0] - sides[1]).max(axis=1)
    # Rounding of a fit on [0, 1], of a condition of about 1e4 with powers up to 6.
    assert (jumps[:2] < 1e-10).all()
    assert (jumps[2] < 1e-10) if weight == "quintic" else (jumps[2] > 0.1)


@BOTH
def test_bounds_mean_and_variance(weight):
    values = np.concatenate(
        [signed_noise(random_points(60_000, seed), weight=weight, seed=seed) for seed in range(8)]
    )
    known = WEIGHTS[weight]
    assert np.abs(values).max() <= known.bound
    assert np.abs(values).max() > 0.7 * known.bound
    # Eight seeds lie within 3 sigma / sqrt(8) of the mean over seeds: 1 to 2 percent of it.
    assert (values**2).mean() == pytest.approx(known.variance[1], rel=0.03)
    assert np.abs(values).mean() == pytest.approx(known.size[1], rel=0.02)
    # About 5e5 samples of deviation 0.18 or 0.27, and gradients that do not sum to 0 exactly.
    assert abs(values.mean()) < 0.003


def test_variance_of_the_cubic_form_has_a_closed_form():
    t = (np.arange(10_000) + 0.5) / 10_000
    w2 = (2 * t**3 - 3 * t**2 + 1) ** 2
    plain, squared = 2 * w2.mean(), 2 * (w2 * t * t).mean()
    # Gradients of length 1 and no correlation: a third along each axis. In a plane through lattice
    # points only its four corners and the slopes along two axes count.
    expected = (2 * squared * plain / 3, squared * plain * plain)
    assert WEIGHTS["cubic"].variance == pytest.approx(expected, rel=1e-3)


@BOTH
def test_bound_is_that_of_eight_gradients_that_meet(weight):
    """The greatest sum over corners of w |o|, or of w max(G . o), over a grid of points."""
    known, slopes = WEIGHTS[weight], gradients(weight, 0)
    t = np.linspace(0.0, 1.0, 41)
    points = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3)
    total = np.zeros(len(points))
    for corner in product((0, 1), repeat=3):
        off = points - corner
        size = np.abs(off)
        fall = 2 * size**3 - 3 * size**2 + 1
        if weight == "quintic":
            fall = 1 - size**3 * (6 * size**2 - 15 * size + 10)
        reach = np.linalg.norm(off, axis=1)
        if weight == "quintic":
            reach = (off @ slopes[:16].T).max(axis=1)
        total += fall.prod(axis=1) * reach
    # A grid of 1/40 misses a smooth maximum by a curvature of about 5, times (1/80)^2 / 2.
    assert known.bound - 1e-3 < total.max() <= known.bound + 1e-12


@BOTH
def test_it_repeats_after_256_cells_and_far_out(weight):
    points = np.random.default_rng(0).integers(-500, 500, (500, 3)) / 16.0
    here = signed_noise(points, weight=weight)
    assert np.abs(here).max() > 0.2
    # Sixteenths stay exact up to 2^49.
    for far in (256.0, -256.0, 256.0 * 4_000_000, -(2.0**40), 2.0**48):
        np.testing.assert_array_equal(signed_noise(points + far, weight=weight), here)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -(2.0**51)])
def test_coordinates_that_are_no_place_count_as_0(odd):
    points = random_points(50)
    for axis in range(3):
        with_odd, with_0 = points.copy(), points.copy()
        with_odd[:, axis], with_0[:, axis] = odd, 0.0
        np.testing.assert_array_equal(signed_noise(with_odd), signed_noise(with_0))


def test_two_coordinates_are_the_plane_z_0():
    points = random_points(200)
    points[:, 2] = 0.0
    np.testing.assert_array_equal(signed_noise(points), signed_noise(points[:, :2]))


@BOTH
def test_seeds_differ_and_repeat(weight):
    points = random_points(2000)
    values = [signed_noise(points, weight=weight, seed=seed) for seed in (0, 1, -1, 0, 2**64)]
    np.testing.assert_array_equal(values[0], values[3])
    np.testing.assert_array_equal(values[0], values[4])
    # Independent: 2000 samples leave a correlation of 1 / sqrt(2000) = 0.02 by chance.
    assert abs(np.corrcoef(values[0], values[1])[0, 1]) < 0.1
    assert abs(np.corrcoef(values[0], values[2])[0, 1]) < 0.1


def test_the_generator_gives_the_published_numbers():
    random = _SplitMix64(1234567)
    assert [random._next() for _ in range(3)] == [
        6457827717110365317, 3203168211198807973, 9817491932198370423,
    ]  # fmt: skip


def test_tables_are_what_they_say():
    tables = lattice(3)
    np.testing.assert_array_equal(np.sort(tables.permutation[:256]), np.arange(256))
    np.testing.assert_array_equal(tables.permutation[256:], tables.permutation[:256])
    np.testing.assert_allclose(np.linalg.norm(tables.sphere, axis=1), 1.0, rtol=1e-15)
    assert {tuple(sorted(map(abs, row))) for row in tables.edges.tolist()} == {(0.0, 1.0, 1.0)}
    assert len(np.unique(tables.edges, axis=0)) == 12
    assert tables.places.min() >= 0.0
    assert tables.places.max() < 1.0
    # 256 unit vectors even over the sphere: their mean is about 1 / 16 long.
    assert np.linalg.norm(tables.sphere.mean(axis=0)) < 0.2
