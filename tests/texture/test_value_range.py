"""Ranges, counts and percentiles of values, against numpy on the values that are covered."""

import numpy as np
import pytest

from texbake.texture.value_range import (
    channel_ranges,
    count_clipped,
    height_range,
    size_at_percentile,
)


@pytest.mark.parametrize("percentile", [0.0, 33.0, 99.0, 100.0])
@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (90, 70), (40, 30, 3)])
def test_size_at_percentile_is_that_of_sorted_values(shape, percentile):
    rng = np.random.default_rng(0)
    for values in (
        rng.normal(size=shape),
        rng.integers(-2, 3, shape) * 0.1,
        rng.normal(size=shape) * 10.0 ** rng.uniform(-40, 30, shape),
    ):
        values = values.astype(np.float32)
        covered = rng.random(shape[:2]) < 0.7
        covered[0, 0] = True
        expected = np.percentile(np.abs(values[covered]), percentile)
        found = size_at_percentile(values, covered, percentile)
        # An interpolated value has the rounding error of a float32 of the greater neighbor.
        assert found == pytest.approx(float(expected), rel=3e-7, abs=1e-44)


def test_nothing_covered_has_the_size_0():
    assert size_at_percentile(np.ones((2, 2), np.float32), np.zeros((2, 2), bool), 99.0) == 0.0


def test_vectors_count_only_where_they_are_covered():
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(50, 60, 3)).astype(np.float32)
    vectors[3, 4] = np.inf
    covered = rng.random((50, 60)) < 0.5
    values = vectors[covered]
    values = values[np.isfinite(values)]
    assert height_range(vectors, covered, mid=0.5) == (0.5, 2.0 * float(np.abs(values).max()))
    covered[3, 4] = False
    clipped = np.count_nonzero(np.abs(vectors[covered]) > 1.0)
    assert count_clipped(vectors, covered, mid=0.5, scale=2.0) == clipped


@pytest.mark.parametrize("shape", [(1, 1), (50, 60), (900, 800, 3)])
def test_ranges_are_those_of_each_channel_where_texels_are_covered(shape):
    rng = np.random.default_rng(3)
    values = rng.normal(size=shape).astype(np.float32)
    covered = rng.random(shape[:2]) < 0.5
    covered[0, 0] = True
    values[~covered] = 9.0
    rows = values[covered].reshape(np.count_nonzero(covered), -1)
    expected = np.stack([rows.min(axis=0), rows.max(axis=0)], axis=1)
    np.testing.assert_array_equal(channel_ranges(values, covered), expected)
    values[covered] = np.nan
    nothing = np.tile(np.float32([np.inf, -np.inf]), (rows.shape[1], 1))
    np.testing.assert_array_equal(channel_ranges(values, covered), nothing)
