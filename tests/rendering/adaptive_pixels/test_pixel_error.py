"""Estimated errors of made sums, in closed form."""

import numpy as np
import pytest

from texbake.rendering.adaptive_pixels.pixel_statistics import (
    PixelSums,
    code_means,
    edge_errors,
    shading_errors,
)
from texbake.texture.encoding import encode_srgb


def sums_of(means, deviation=0.0, count=16):
    """Sums of gray pixels with given means and deviations; all are opaque."""
    means = np.asarray(means, np.float64)
    sums = PixelSums.empty(*means.shape)
    sums.counts[...] = count
    sums.light[..., :3] = count * means[..., None]
    sums.squares[..., :3] = count * (means**2 + np.asarray(deviation) ** 2)[..., None]
    sums.light[..., 3] = sums.squares[..., 3] = count
    return sums


def codes_of(sums):
    codes = np.zeros(sums.light.shape, np.float32)
    code_means(sums, codes, threads=1)
    return codes


def once(shape):
    return np.ones(shape, np.int32), np.zeros(shape, np.float32)


def test_codes_are_those_of_a_file():
    means = np.array([[-0.1, 0.0, 0.003, 0.0032, 0.2, 1.0, 7.0]])
    codes = codes_of(sums_of(means))
    np.testing.assert_allclose(codes[..., 0], encode_srgb(means), atol=1e-7)
    assert (codes[..., 3] == 1.0).all()


def test_an_even_picture_has_no_errors():
    sums = sums_of(np.full((4, 5), 0.3))
    assert edge_errors(sums, threads=1).max() < 1e-6  # of squares, in float64
    assert not shading_errors(codes_of(sums), *once((4, 5)), threads=1).any()


def test_a_slope_has_none_and_a_bend_a_quarter_of_it():
    """Codes that grow by 0.1 up to a bend, after which they stay: the second difference is 0.1."""
    codes = np.zeros((3, 5, 4), np.float32)
    codes[..., 0] = [0.0, 0.1, 0.2, 0.2, 0.2]
    errors = shading_errors(codes, *once((3, 5)), threads=1)
    # At the border of the picture the one difference there is counts.
    np.testing.assert_allclose(errors[1], [0.025, 0.0, 0.025, 0.0, 0.0], atol=1e-7)


def test_what_changed_tells_of_finer_shading():
    shaded = np.full((1, 5), 2, np.int32)
    changes = np.array([[0.0, 0.0, 0.3, 0.0, 0.0]], np.float32)
    errors = shading_errors(np.zeros((1, 5, 4), np.float32), shaded, changes, threads=1)
    even = 0.3 / np.sqrt(3.0)  # of a pixel and the two beside it
    np.testing.assert_allclose(errors[0], 0.7 * np.array([0.0, even, 0.3, even, 0.0]), rtol=1e-6)


@pytest.mark.parametrize("count", [16, 64, 256])
def test_edges_leave_less_with_more_samples(count):
    """White over black on half of a pixel: half a step of n^-3/4, coded on the darker side."""
    off = 0.5 * count**-0.75
    error = edge_errors(sums_of([[0.5]], 0.5, count), threads=1)[0, 0]
    assert error == pytest.approx(float(encode_srgb(0.5) - encode_srgb(0.5 - off)), rel=1e-5)


def test_what_the_slope_explains_is_no_edge():
    """Samples of a slope of 0.1 a pixel deviate by 0.1 (1 - 1 / n)^1/2 / sqrt(12)."""
    deviation = 0.1 * np.sqrt((1 - 1 / 16) / 12)
    means = np.broadcast_to([0.2, 0.3, 0.4, 0.5], (3, 4))
    assert edge_errors(sums_of(means, deviation), threads=1)[1, 1:3].max() < 1e-6
    flat = edge_errors(sums_of(np.full((3, 4), 0.3), deviation), threads=1)
    assert flat.min() > 1e-3


def test_a_leap_between_pixels_is_seen_in_both():
    errors = edge_errors(sums_of(np.broadcast_to([0.0, 0.0, 1.0, 1.0], (3, 4))), threads=1)
    off = 0.5 * 16**-0.75
    assert errors[1, 1] == pytest.approx(float(encode_srgb(off)), rel=1e-5)
    assert errors[1, 2] == pytest.approx(float(1.0 - encode_srgb(1.0 - off)), rel=1e-5)
    assert not errors[1, 0] and not errors[1, 3]
