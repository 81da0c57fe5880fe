"""Kernels of texture lookup: wrap modes, and interpolation between four texels.

A texture coordinate (u, v) has v up and (0, 0) at the lower left corner of the image; row 0 of an
image is its top. In texels, the continuous coordinates (x, y) run down from the top edge, and the
center of the texel in column i and row j is (i + 0.5, j + 0.5). `row_of_v` is the one place where
v up becomes rows down.

All kernels here are made to be called from other kernels.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for texel centers and
bilinear interpolation; the OpenGL 4.6 specification, section 8.14, for the wrap modes. Departs from
the latter in that the weights are float64.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

REPEAT = 0
CLAMP = 1
MIRROR = 2
BORDER = 3

# Index of a texel that lies outside an image with a border.
OUTSIDE = -1

# Coordinates that do not repeat are limited to this, so that texels can be counted.
_FARTHEST = float(1 << 30)


@kernel
def row_of_v(v, height):  # type: ignore[no-untyped-def]
    """Continuous row, down from the top edge, of a v that goes up from the bottom edge.

    Its own inverse on the unit square: `row_of_v(row / height, 1.0)` is the v of a row.
    """
    return (1.0 - v) * height


@kernel
def wrap_to_unit(u, wrap):  # type: ignore[no-untyped-def]
    """Coordinate in [0, 1] that reads the same as `u`; with a border, `u` itself.

    One that is not a number counts as 0, and so does an infinite one that repeats or is mirrored.
    """
    if wrap == REPEAT:
        u -= np.floor(u)
        # False for what is not a number, and for 1 left over from a negative number too small to
        # subtract from 1.
        return u if u < 1.0 else 0.0
    if wrap == MIRROR:
        u = abs(u - 2.0 * np.floor(0.5 * u + 0.5))
        return u if u <= 1.0 else 0.0
    if wrap == CLAMP:
        return min(u, 1.0) if u > 0.0 else 0.0
    return u if u == u else 0.0


@kernel
def wrap_to_period(u, wrap):  # type: ignore[no-untyped-def]
    """Coordinate about which all texels stand as they do about `u`, small enough to count texels.

    In [0, 1) where the image repeats and in [0, 2) where it is mirrored. NaN and infinity count as
    in `wrap_to_unit`. To be used with `wrap_index`, by lookups that read more than the next texel.
    """
    if wrap == REPEAT:
        return wrap_to_unit(u, wrap)
    if wrap == MIRROR:
        u -= 2.0 * np.floor(0.5 * u)
        return u if u < 2.0 else 0.0
    return max(min(u, _FARTHEST), -_FARTHEST) if u == u else 0.0


@kernel
def wrap_index(index, size, wrap):  # type: ignore[no-untyped-def]
    """Row or column that stands at any index along an axis of `size` texels; OUTSIDE for none."""
    if index >= 0 and index < size:
        return index
    if wrap == REPEAT:
        return index % size
    if wrap == MIRROR:
        index %= 2 * size
        return min(index, 2 * size - 1 - index)
    if wrap == CLAMP:
        return 0 if index < 0 else size - 1
    return OUTSIDE


@kernel
def texel_at(column, row, width, height, wrap):  # type: ignore[no-untyped-def]
    """Index, counted along rows, of the texel that stands in any column and row; or OUTSIDE."""
    column = wrap_index(column, width, wrap)
    row = wrap_index(row, height, wrap)
    return row * width + column if column >= 0 and row >= 0 else OUTSIDE


@kernel
def _neighbors(x, size, wrap):  # type: ignore[no-untyped-def]
    """Texels to either side of a place along an axis, and how far between them it lies.

    `x` is 0 at the first center; `wrap_to_unit` has been applied, so that no division is needed.
    """
    # With a border, a texel beyond the edge there is nothing else to come.
    x = min(max(x, -1.0), float(size))
    floor = np.floor(x)
    left = int(floor)
    right = left + 1
    if left < 0 or right >= size:
        before = after = OUTSIDE
        if wrap == REPEAT:
            before, after = size - 1, 0
        elif wrap != BORDER:
            before, after = 0, size - 1
        if left < 0:
            left = before
        elif left >= size:
            left = after
        if right >= size:
            right = after
    return left, right, x - floor


@kernel
def bilinear_cell(u, v, width, height, wrap, first):  # type: ignore[no-untyped-def]
    """Four texels about a `wrap_to_unit` coordinate, and how far between them it lies.

    `first` is the index of the image's first texel. Returns the indices of the texels above left,
    above right, below left and below right, OUTSIDE for the border, then x and y in [0, 1).
    """
    left, right, x = _neighbors(u * width - 0.5, width, wrap)
    top, bottom, y = _neighbors(row_of_v(v, height) - 0.5, height, wrap)
    above = first + top * width
    below = first + bottom * width
    if wrap == BORDER:
        return (
            (
                above + left if left >= 0 and top >= 0 else OUTSIDE,
                above + right if right >= 0 and top >= 0 else OUTSIDE,
                below + left if left >= 0 and bottom >= 0 else OUTSIDE,
                below + right if right >= 0 and bottom >= 0 else OUTSIDE,
            ),
            x,
            y,
        )
    return (above + left, above + right, below + left, below + right), x, y


@kernel
def interpolate_cell(texels, cell, x, y, channel, outside):  # type: ignore[no-untyped-def]
    """Interpolate one channel between the four texels of a cell; exact where they are equal.

    Parameters
    ----------
    texels : (N, C) float32
    cell, x, y
        As from `bilinear_cell`; the precision of the latter two is that of the result.
    outside : float32
        Value of the border.
    """
    above_left, above_right, below_left, below_right = cell
    a = texels[above_left, channel] if above_left >= 0 else outside
    b = texels[above_right, channel] if above_right >= 0 else outside
    c = texels[below_left, channel] if below_left >= 0 else outside
    d = texels[below_right, channel] if below_right >= 0 else outside
    above = a + x * (b - a)
    below = c + x * (d - c)
    return above + y * (below - above)
