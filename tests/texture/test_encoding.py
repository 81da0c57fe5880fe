"""Codes of values, normals, heights and colors, and the ranges that heights are coded in."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from texbake.errors import OptionError
from texbake.texture.encoding import (
    channel_ranges,
    color_ids,
    count_clipped,
    decode_heights,
    decode_normals,
    decode_srgb,
    encode_heights,
    encode_normals,
    encode_srgb,
    height_range,
    max_code,
    quantize_srgb,
    quantize_unsigned,
    size_at_percentile,
)

floats = st.floats(-2, 2, width=32)


def half_up(value, top):
    """The nearest code of a Fraction, halves up."""
    return min(max((2 * value * top + 1) // 2, 0), top)


@pytest.mark.parametrize("bits", [8, 16])
@given(values=arrays(np.float32, 50, elements=floats))
@settings(max_examples=30)
def test_rounding_is_that_of_exact_arithmetic(bits, values):
    top = 2**bits - 1
    exact = [half_up(Fraction(float(value)), top) for value in values]
    assert quantize_unsigned(values, bits).tolist() == exact


@pytest.mark.parametrize("convention", ["opengl", "directx"])
def test_flat_is_one_color_also_with_float32_noise(convention):
    noise = np.random.default_rng(0).uniform(-3e-6, 3e-6, (1000, 3))
    flat = (np.array([0.0, 0.0, 1.0]) + noise * [1, 1, 0.1]).astype(np.float32)
    codes = encode_normals(flat, bits=8, convention=convention)
    assert (codes == [128, 128, 255]).all()
    codes = encode_normals(flat, bits=16, convention=convention)
    assert (codes == [32768, 32768, 65535]).all()


@pytest.mark.parametrize("bits", [8, 16])
@given(values=arrays(np.float32, 30, elements=st.floats(-1, 1, width=32)))
@settings(max_examples=30)
def test_all_but_flat_components_round_exactly(bits, values):
    top = 2**bits - 1
    values = np.where(np.abs(values) <= 4e-6, np.float32(0.25), values)
    codes = encode_normals(values.reshape(-1, 3), bits=bits)
    exact = [half_up((Fraction(float(value)) + 1) / 2, top) for value in values]
    assert codes.ravel().tolist() == exact


def test_colors_without_direction_decode_to_the_axis():
    pixels = np.array([[0.5, 0.5, 0.5], [np.nan, 0.5, 1.0], [np.inf, 0.0, 0.0]], np.float32)
    assert decode_normals(pixels).tolist() == [[0.0, 0.0, 1.0]] * 3


@pytest.mark.parametrize("bits", [8, 16])
def test_no_displacement_comes_back_as_exactly_none(bits):
    heights = np.array([[-0.3, 0.0, 0.2]])
    mid, scale = height_range(heights, np.ones((1, 3), bool), bits=bits)
    codes = encode_heights(heights, bits=bits, mid=mid, scale=scale)
    assert codes[0, 1] == 2 ** (bits - 1)
    assert decode_heights(codes, mid=mid, scale=scale)[0, 1] == 0.0


def test_the_range_is_the_least_that_clips_nothing():
    heights = np.array([[-1.0, 3.0]])
    covered = np.ones((1, 2), bool)
    assert height_range(heights, covered, mid=0.5) == (0.5, 6.0)
    assert height_range(heights, covered, mid=0.25) == (0.25, 4.0)
    assert height_range(heights, np.array([[True, False]]), mid=0.25) == (0.25, 4.0)
    assert height_range(heights[:, :1], covered[:, :1], mid=1.0) == (1.0, 1.0)


@pytest.mark.parametrize("heights", [np.zeros((2, 2)), np.full((2, 2), np.nan)])
def test_a_map_without_range_is_flat_at_its_mid_level(heights):
    mid, scale = height_range(heights, np.ones((2, 2), bool))
    assert (mid, scale) == (32768 / 65535, 1.0)
    assert height_range(heights, np.zeros((2, 2), bool)) == (mid, scale)
    flat = encode_heights(np.zeros((2, 2)), bits=16, mid=mid, scale=scale)
    assert (flat == 32768).all()


def test_heights_beyond_a_given_range_are_clipped_and_counted():
    heights = np.array([[-2.0, -0.5, 0.5, 2.0]])
    assert encode_heights(heights, bits=8, mid=0.5, scale=1.0).tolist() == [[0, 0, 255, 255]]
    covered = np.array([[True, True, True, True]])
    assert count_clipped(heights, covered, mid=0.5, scale=1.0) == 2
    assert count_clipped(heights, ~covered, mid=0.5, scale=1.0) == 0


def test_float_levels_are_not_clipped_and_can_be_the_heights_themselves():
    heights = np.array([[-2.0, 0.1]], np.float32)
    np.testing.assert_array_equal(encode_heights(heights, bits=32, mid=0.0, scale=1.0), heights)
    levels = encode_heights(heights, bits=32, mid=0.5, scale=2.0)
    np.testing.assert_allclose(levels, heights / 2 + 0.5, rtol=1e-6)


@pytest.mark.parametrize("bits", [8, 16])
def test_srgb_codes_are_those_of_encoded_values_and_come_back(bits):
    values = np.random.default_rng(5).uniform(-0.1, 1.1, (200_000, 4)).astype(np.float32) ** 3
    colors = encode_srgb(values[:, :3])
    codes = quantize_srgb(values, bits, n_colors=3)
    assert np.array_equal(codes[:, :3], quantize_unsigned(colors, bits))
    assert np.array_equal(codes[:, 3], quantize_unsigned(values, bits)[:, 3])
    assert quantize_srgb(np.array([np.nan, np.inf, -np.inf]), bits).tolist() == [
        0, max_code(bits), 0,
    ]  # fmt: skip
    codes = np.arange(max_code(bits) + 1)
    linear = decode_srgb(codes / max_code(bits)).astype(np.float32)
    assert np.array_equal(quantize_srgb(linear, bits), codes)


def test_srgb_is_its_own_inverse_and_has_the_known_points():
    # IEC 61966-2-1: the two pieces meet at 0.04045; 0.5 in sRGB is 0.21404 linear.
    assert decode_srgb(0.5) == pytest.approx(0.214041, abs=1e-6)
    assert decode_srgb(0.04045) == pytest.approx(0.04045 / 12.92, rel=1e-9)
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(encode_srgb(decode_srgb(values)), values, atol=1e-6)
    assert encode_srgb([-1.0, 2.0]).tolist() == [0.0, pytest.approx(1.0, abs=1e-6)]


def test_wrong_options_are_errors():
    flat = np.array([[0.0, 0.0, 1.0]])
    with pytest.raises(OptionError, match="8 or 16 bits, not 12"):
        encode_normals(flat, bits=12)
    with pytest.raises(OptionError, match="'vulkan' is not known"):
        encode_normals(flat, bits=8, convention="vulkan")
    with pytest.raises(OptionError, match="'vulkan' is not known"):
        decode_normals(flat, convention="vulkan")
    for scale in (0.0, np.nan, np.inf):
        with pytest.raises(OptionError, match="maps no heights"):
            encode_heights(flat, bits=8, mid=0.5, scale=scale)
    with pytest.raises(OptionError, match="not a level"):
        height_range(flat, flat > 0, mid=1.5)
    with pytest.raises(OptionError, match="leaves no room"):
        height_range(flat, np.ones((1, 3), bool), mid=1.0)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_an_id_gets_its_color_and_one_that_is_no_number_the_first(dtype):
    ids = np.array([[np.nan, np.inf, -np.inf], [1e30, 1.9, 0.0]], dtype=np.float32)
    colors = np.arange(9, dtype=dtype).reshape(3, 3)
    codes = color_ids(ids, colors)
    assert codes.dtype == dtype and codes.tolist() == colors[[[0, 2, 0], [2, 1, 0]]].tolist()


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
