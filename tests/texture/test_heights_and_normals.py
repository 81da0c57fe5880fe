"""Heights to normals and back, held against closed forms."""

import numpy as np
import pytest

from texbake.errors import FileFormatError, OptionError
from texbake.metadata import CONVENTION, DISPLACEMENT_SCALE, SPACE
from texbake.texture.heights_and_normals import height_to_normal, normal_to_height
from texbake.texture.image import Image
from texbake.texture.options import (
    DERIVATIVES,
    HEIGHT_WRAPS,
    INTEGRATIONS,
    HeightToNormalOptions,
    NormalToHeightOptions,
)

Array = np.ndarray

# float32 normals of slopes of about 1: what one rounding of a component does to a slope.
SLOPE_ROUNDING = 4e-7


def normals_of(right, up):
    normals = np.stack([-right, -up, np.ones_like(right)], axis=-1)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def waves(height, width):
    """Heights in texels of waves that tile, and their true slopes to the right and up."""
    y, x = np.mgrid[:height, :width] + 0.5
    a, b = 2 * np.pi * 3 / width, 2 * np.pi * 2 / height
    heights = np.sin(a * x + 0.3) * np.cos(b * y) * 2.0
    right = a * np.cos(a * x + 0.3) * np.cos(b * y) * 2.0
    up = b * np.sin(a * x + 0.3) * np.sin(b * y) * 2.0
    return heights, right, up


def paraboloid(height, width):
    """Heights that curve evenly, with a twist, and their true slopes to the right and up."""
    y, x = np.mgrid[:height, :width] + 0.5
    heights = 0.02 * x**2 - 0.013 * y**2 + 0.007 * x * y - 0.3 * x + 0.11 * y
    return heights, 0.04 * x + 0.007 * y - 0.3, -(-0.026 * y + 0.007 * x + 0.11)


@pytest.mark.parametrize("derivative", DERIVATIVES)
def test_normals_of_a_paraboloid_are_exact_up_to_the_border(derivative):
    heights, right, up = paraboloid(24, 40)
    options = HeightToNormalOptions(scale=1.0, width=40.0, wrap="clamp", derivative=derivative)
    np.testing.assert_allclose(
        height_to_normal(heights, options), normals_of(right, up), atol=SLOPE_ROUNDING
    )


@pytest.mark.parametrize(("derivative", "side"), [("central", 0), ("sobel", 4), ("scharr", 3)])
@pytest.mark.parametrize("shape", [(32, 48), (31, 17)])
def test_differences_lower_a_wave_by_sin_w_over_w_and_some_average_across(shape, derivative, side):
    heights, right, up = waves(*shape)
    a, b = 2 * np.pi * 3 / shape[1], 2 * np.pi * 2 / shape[0]

    def averaged(w):
        return (16 - 2 * side + 2 * side * np.cos(w)) / 16

    expected = normals_of(right * np.sin(a) / a * averaged(b), up * np.sin(b) / b * averaged(a))
    options = HeightToNormalOptions(scale=1.0, width=shape[1], derivative=derivative)
    np.testing.assert_allclose(height_to_normal(heights, options), expected, atol=SLOPE_ROUNDING)


def test_scale_and_width_are_one_ratio():
    heights = waves(16, 16)[0]
    a = height_to_normal(heights, HeightToNormalOptions(scale=0.1, width=2.0))
    b = height_to_normal(heights, HeightToNormalOptions(scale=0.05, width=1.0))
    np.testing.assert_array_equal(a, b)
    flipped = height_to_normal(heights, HeightToNormalOptions(scale=-0.05))
    np.testing.assert_allclose(flipped, b * (-1, -1, 1), atol=1e-7)


@pytest.mark.parametrize("wrap", HEIGHT_WRAPS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (2, 2), (5, 1), (2, 3)])
def test_the_smallest_images(shape, wrap):
    normals = height_to_normal(np.full(shape, 7.0), HeightToNormalOptions(wrap=wrap))
    np.testing.assert_array_equal(normals, np.tile([0.0, 0.0, 1.0], (*shape, 1)))
    for method in INTEGRATIONS:
        field = normal_to_height(normals, NormalToHeightOptions(method=method, wrap=wrap))
        np.testing.assert_array_equal(field.heights, np.zeros(shape))


def test_values_that_are_not_finite_become_flat_and_do_not_spread():
    heights = waves(16, 16)[0]
    whole = height_to_normal(heights)
    heights[5, 5] = np.nan
    heights[9, 9] = np.inf
    normals = height_to_normal(heights)
    assert np.isfinite(normals).all()
    changed = (normals != whole).any(axis=-1)
    ys, xs = np.nonzero(changed)
    assert {(4, 5), (5, 4), (8, 9)} <= set(zip(ys.tolist(), xs.tolist(), strict=True))
    assert changed.sum() <= 10
    np.testing.assert_array_equal(normals[5, 4], (0, 0, 1))


@pytest.mark.parametrize("shape", [(32, 48), (31, 17), (1, 40)])
def test_frankot_chellappa_integrates_waves_that_tile_exactly(shape):
    heights, right, up = waves(*shape)
    if shape[0] == 1:
        up = np.zeros_like(up)
    options = NormalToHeightOptions(method="frankot-chellappa", width=float(shape[1]))
    field = normal_to_height(normals_of(right, up), options)
    np.testing.assert_allclose(field.heights, heights - heights.mean(), atol=1e-6)
    assert field.rms_slope_error < 1e-9
    assert field.n_steep == 0


@pytest.mark.parametrize("shape", [(24, 40), (25, 33)])
def test_poisson_integrates_a_paraboloid_exactly(shape):
    heights, right, up = paraboloid(*shape)
    options = NormalToHeightOptions(wrap="clamp", width=float(shape[1]))
    field = normal_to_height(normals_of(right, up), options)
    np.testing.assert_allclose(field.heights, heights - heights.mean(), atol=1e-6)
    assert field.rms_slope_error < 1e-9


@pytest.mark.parametrize("method", INTEGRATIONS)
def test_round_trip_of_waves_agrees_with_the_closed_form(method):
    """A wave of w radians per texel returns as sin w / w (one derivative) or cos² w/2 of itself."""
    n, k = 64, 4
    w = 2 * np.pi * k / n
    heights = np.tile(np.sin(w * np.arange(n)), (n, 1))
    normals = height_to_normal(heights, HeightToNormalOptions(scale=1.0, width=n))
    field = normal_to_height(normals, NormalToHeightOptions(method=method, width=n))
    kept = np.sin(w) / w if method == "frankot-chellappa" else np.cos(w / 2) ** 2
    # float32 normals, each of whose roundings the integration carries on over a wave.
    np.testing.assert_allclose(field.heights, kept * heights, atol=2e-6)
    assert np.abs(field.heights - heights).max() < 0.04


def test_slopes_without_a_surface_are_fitted_and_reported():
    """A whirl has slopes that no heights have: the best fit is flat, and all is left over."""
    y, x = np.mgrid[:32, :32] + 0.5
    w = 2 * np.pi / 32
    # A rotation field, the derivative across of sin(wx) sin(wy), has no potential part.
    right, up = np.sin(w * x) * np.cos(w * y), np.cos(w * x) * np.sin(w * y)
    for method in INTEGRATIONS:
        field = normal_to_height(normals_of(right, up), NormalToHeightOptions(method=method))
        # The wave is the same across and along, so no method takes one for steeper.
        np.testing.assert_allclose(field.heights, 0.0, atol=1e-9)
        assert field.rms_slope_error > 0.6


def test_an_image_is_read_as_it_says_of_itself():
    heights, right, up = waves(32, 48)
    pixels = ((normals_of(right, -up) + 1) / 2).astype(np.float32)
    labeled = Image(pixels, {CONVENTION: "directx"})
    silent = NormalToHeightOptions(convention="directx", width=48.0)
    for image, options in ((labeled, NormalToHeightOptions(width=48.0)), (Image(pixels), silent)):
        field = normal_to_height(image, options)
        assert field.rms_slope_error < 0.01
        assert np.corrcoef(field.heights.ravel(), heights.ravel())[0, 1] > 0.9999
    # Taken the wrong way, the slopes are those of no surface.
    assert normal_to_height(Image(pixels)).rms_slope_error > 0.1
    with pytest.raises(FileFormatError, match=r"n\.png: its normals are in object space"):
        normal_to_height(Image(pixels, {SPACE: "object"}, name="n.png"))
    scaled = Image(heights[..., None].astype(np.float32), {DISPLACEMENT_SCALE: 0.25})
    np.testing.assert_allclose(
        height_to_normal(scaled),
        height_to_normal(heights, HeightToNormalOptions(scale=0.25)),
        atol=1e-6,
    )
    wrong = Image(heights[..., None].astype(np.float32), {DISPLACEMENT_SCALE: "x"}, name="h.png")
    with pytest.raises(FileFormatError, match=r"h\.png: its texbake:displacement_scale 'x'"):
        height_to_normal(wrong)


def test_steep_normals_are_counted():
    normals = np.tile([0.0, 0.0, 1.0], (8, 8, 1))
    normals[2, 3] = (1.0, 0.0, 0.0)
    normals[4, 4] = (0.0, 0.6, -0.8)
    normals[5, 5] = np.nan
    normals[6, 6] = 0.0
    field = normal_to_height(normals)
    assert field.n_steep == 3
    assert np.isfinite(field.heights).all()


def test_wrong_input_is_one_clear_error():
    with pytest.raises(OptionError, match=r"heights: the shape \(2, 2, 3\)"):
        height_to_normal(np.zeros((2, 2, 3)))
    with pytest.raises(OptionError, match=r"normals: the shape \(2, 2\)"):
        normal_to_height(np.zeros((2, 2)))
