"""Kernel of anisotropic filtering: the mean over the ellipse that a pixel covers on the texture.

A pixel, taken as a round Gaussian, becomes an elliptical one on the texture. Texels are read from
the two mip levels on which the minor axis of the ellipse is one to two texels long, so that detail
across that axis is kept however long the ellipse is. Their weights come from a table over the
squared distance.

Based on: Greene and Heckbert, "Creating Raster Omnimax Images from Multiple Perspective Views Using
the Elliptical Weighted Average Filter", 1986; Heckbert, "Fundamentals of Texture Mapping and Image
Warping", 1989; Pharr, Jakob and Humphreys, "Physically Based Rendering", for the bound on the ratio
of the axes and the weights that end at 0. Departs from them in that the axes are those of the
ellipse and not the derivatives, which need not be perpendicular; in that the pixel's part of the
ellipse has the variance of a square pixel, which is narrower than their unit circle; and in that a
magnified texture is interpolated, with a transition until the major axis is two texels long.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.interpolation import (
    bilinear_cell,
    interpolate_cell,
    row_of_v,
    texel_at,
    wrap_index,
    wrap_to_period,
    wrap_to_unit,
)

# Weights over r², the squared distance from the center with 1 on the ellipse: exp(-2 r²), lowered
# so that it ends at 0.
_N_WEIGHTS = 1024
_SQUARED = (np.arange(_N_WEIGHTS) + 0.5) / _N_WEIGHTS
WEIGHTS = (np.exp(-2.0 * _SQUARED) - np.exp(-2.0)).astype(np.float32)
WEIGHTS.flags.writeable = False

# Squared radius of the ellipse in steps of a pixel, with which the variance along an axis is 1/12,
# that of a square pixel: the weights' own is 0.136 of it.
PIXEL_RADIUS_SQUARED = float(2.0 / 12.0 * WEIGHTS.sum() / (WEIGHTS * _SQUARED).sum())

# Derivatives beyond this count as this, so that their squares can be computed.
_LARGEST = 1e15


@kernel
def _footprint(derivatives, width, height):  # type: ignore[no-untyped-def]
    """Quadratic form (xx, xy, yy) of a pixel on the image, in squared texels, y down.

    Its eigenvalues are the squared lengths of the axes of the ellipse that a circle of one pixel's
    radius becomes. What is not a number counts as no change.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in (0, 2):
        along = np.float64(derivatives[k]) * width
        down = -np.float64(derivatives[k + 1]) * height
        along = min(max(along, -_LARGEST), _LARGEST) if along == along else 0.0
        down = min(max(down, -_LARGEST), _LARGEST) if down == down else 0.0
        xx += along * along
        xy += along * down
        yy += down * down
    return xx, xy, yy


@kernel
def _bounded(xx, xy, yy, max_anisotropy, largest):  # type: ignore[no-untyped-def]
    """Form with the ratio of its axes bounded, and the lengths of the axes.

    The minor axis is lengthened to `1 / max_anisotropy` of the major, then cut to `largest`, the
    size of the texels of the last level, and the major to `max_anisotropy` times that.
    """
    middle = 0.5 * (xx + yy)
    half_gap = np.hypot(0.5 * (xx - yy), xy)
    major = middle + half_gap
    minor = max(middle - half_gap, 0.0)
    new_minor = min(max(minor, major / max_anisotropy**2), largest**2)
    new_major = min(major, new_minor * max_anisotropy**2)
    scale = (new_major - new_minor) / (major - minor) if major > minor else 0.0
    rest = new_minor - scale * minor
    return (
        scale * xx + rest,
        scale * xy,
        scale * yy + rest,
        np.sqrt(new_minor),
        np.sqrt(new_major),
    )


@kernel
def _ellipse_mean(texels, first, width, height, u, v, form, wrap, border, weights, out):  # type: ignore[no-untyped-def]
    """Write the weighted mean over an ellipse about a `reduced` coordinate, in texels of a level.

    Differences from one texel are summed, so that a constant stays exactly what it is.
    """
    xx, xy, yy = form
    n_channels = texels.shape[1]
    center_x = u * width - 0.5
    center_y = row_of_v(v, height) - 0.5
    base = texel_at(int(center_x), int(center_y), width, height, wrap)
    # Inverse of the form: 1 on the ellipse.
    determinant = xx * yy - xy * xy
    along, slant, down = yy / determinant, -xy / determinant, xx / determinant
    reach = np.sqrt(yy)
    total = np.float32(0.0)
    for channel in range(n_channels):
        out[channel] = 0.0
    for row in range(int(np.ceil(center_y - reach)), int(np.floor(center_y + reach)) + 1):
        dy = row - center_y
        # The row's part of the ellipse.
        middle = -slant * dy / along
        half = np.sqrt(max((slant * dy) ** 2 - along * (down * dy * dy - 1.0), 0.0)) / along
        start = int(np.ceil(center_x + middle - half))
        stop = int(np.floor(center_x + middle + half)) + 1
        row_start = wrap_index(row, height, wrap) * width
        for column in range(start, stop):
            dx = column - center_x
            squared = along * dx * dx + (2.0 * slant * dx + down * dy) * dy
            place = int(squared * len(weights))
            if place >= len(weights):
                continue
            weight = weights[place]
            total += weight
            column = wrap_index(column, width, wrap)
            inside = column >= 0 and row_start >= 0
            for channel in range(n_channels):
                value = texels[first + row_start + column, channel] if inside else border[channel]
                known = texels[first + base, channel] if base >= 0 else border[channel]
                out[channel] += weight * (value - known)
    for channel in range(n_channels):
        known = texels[first + base, channel] if base >= 0 else border[channel]
        out[channel] = known + out[channel] / total


@kernel
def _level_form(xx, xy, yy, level, size, finest):  # type: ignore[no-untyped-def]
    """Form of the filter on a level: the pixel's, and one texel for the level's own."""
    # Axes of one texel shrink no further.
    half = 0.5**level
    y = min(size[0] / finest[0], half)
    x = min(size[1] / finest[1], half)
    return (
        PIXEL_RADIUS_SQUARED * x * x * xx + 1.0,
        PIXEL_RADIUS_SQUARED * x * y * xy,
        PIXEL_RADIUS_SQUARED * y * y * yy + 1.0,
    )


@kernel
def ewa_kernel(  # type: ignore[no-untyped-def]
    texels, offsets, sizes, uvs, derivatives, anisotropy, wrap, border, weights, out, start, stop
):  # fmt: skip
    """Fill rows `start` to `stop` of `out`."""
    n_channels = texels.shape[1]
    last = len(offsets) - 1
    finest = sizes[0]
    height, width = finest
    mean = np.empty(n_channels, np.float32)
    for i in range(start, stop):
        xx, xy, yy = _footprint(derivatives[i], width, height)
        xx, xy, yy, minor, major = _bounded(xx, xy, yy, anisotropy, 2.0**last)
        share = np.float32(1.0)  # of interpolation
        if major > 1.0:
            share = np.float32(max(2.0 - major, 0.0))
            u, v = wrap_to_period(uvs[i, 0], wrap), wrap_to_period(uvs[i, 1], wrap)
            level = np.log2(minor) if minor > 1.0 else 0.0
            fine = int(level)
            blend = np.float32(level - fine)
            for k in range(fine, fine + (2 if blend > 0.0 else 1)):
                form = _level_form(xx, xy, yy, k, sizes[k], finest)
                _ellipse_mean(
                    texels, offsets[k], sizes[k, 1], sizes[k, 0], u, v, form, wrap, border, weights,
                    mean,
                )  # fmt: skip
                for channel in range(n_channels):
                    near = mean[channel] if k == fine else out[i, channel]
                    out[i, channel] = near + blend * (mean[channel] - near)
        if share > 0.0:
            u, v = wrap_to_unit(uvs[i, 0], wrap), wrap_to_unit(uvs[i, 1], wrap)
            cell, x, y = bilinear_cell(u, v, width, height, wrap, offsets[0])
            x, y = np.float32(x), np.float32(y)
            for channel in range(n_channels):
                value = interpolate_cell(texels, cell, x, y, channel, border[channel])
                mixed = value if share == 1.0 else out[i, channel]
                out[i, channel] = mixed + share * (value - mixed)
