"""Values between texels, and the one place where v up becomes rows down.

A texture coordinate (u, v) has v up and (0, 0) at the lower left corner of the image; row 0 of an
image is its top. In texels, the continuous coordinates (x, y) have y down from the top edge, and
the center of the texel in column i and row j is (i + 0.5, j + 0.5).

`row_of_v`, `bilinear`, and what it is made of, can be called from the kernels of other modules.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for texel centers and
bilinear interpolation; the OpenGL 4.6 specification, section 8.14, for the wrap modes. Departs from
the latter in that the weights are float64.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands

REPEAT = 0
CLAMP = 1
MIRROR = 2
BORDER = 3
_CODES = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP, "border": BORDER}
WRAPS = tuple(_CODES)

# Index of a texel that lies outside an image with a border.
OUTSIDE = -1
# Coordinates that do not repeat are limited to this, so that texels can be counted.
_FARTHEST = float(1 << 30)

# Lookups a band: some milliseconds of work.
_BAND = 1 << 18


def wrap_code(wrap: str) -> int:
    """Number by which kernels know a wrap mode.

    Raises
    ------
    OptionError
        There is no such mode.
    """
    if wrap not in _CODES:
        raise OptionError(f"wrap: {wrap!r} is not known; it is one of {', '.join(_CODES)}")
    return _CODES[wrap]


def border_values(border: npt.ArrayLike | None, n_channels: int) -> npt.NDArray[np.float32]:
    """Values outside an image with a border, one a channel.

    Parameters
    ----------
    border : float, (1,) or (C,), optional
        None: 0 in every channel.
    n_channels
        Of the image.

    Returns
    -------
    (C,) float32

    Raises
    ------
    OptionError
        They are neither one nor as many as the image has channels.
    """
    out = np.empty(n_channels, np.float32)
    try:
        out[:] = 0.0 if border is None else border
    except ValueError as error:
        raise OptionError(
            f"border: {border!r} is not one number or {n_channels}, one for each channel"
        ) from error
    return out


@kernel
def row_of_v(v, height):  # type: ignore[no-untyped-def]
    """Continuous row, down from the top edge, of a v that goes up from the bottom edge.

    Its own inverse on the unit square: `row_of_v(row / height, 1.0)` is the v of a row.
    """
    return (1.0 - v) * height


def texel_coordinates(
    uvs: npt.NDArray[np.float64], width: int, height: int
) -> npt.NDArray[np.float64]:
    """Texture coordinates in texels.

    Parameters
    ----------
    uvs : (..., 2) float64
        Texture coordinates, v up.
    width, height
        Of the image, in texels.

    Returns
    -------
    (..., 2) float64
        Continuous x and y, y down from the top edge; texel centers lie at halves.

    Examples
    --------
    >>> texel_coordinates(np.array([[0.0, 1.0], [1.0, 0.0]]), 8, 4).tolist()
    [[0.0, 0.0], [8.0, 4.0]]
    """
    uvs = np.asarray(uvs, dtype=np.float64)
    with np.errstate(over="ignore"):  # beyond float64 is outside of every image
        return np.stack([uvs[..., 0] * width, row_of_v.py_func(uvs[..., 1], height)], axis=-1)


@kernel
def folded(u, wrap):  # type: ignore[no-untyped-def]
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
def reduced(u, wrap):  # type: ignore[no-untyped-def]
    """Coordinate about which all texels stand as they do about `u`, small enough to count texels.

    In [0, 1) where the image repeats and in [0, 2) where it is mirrored. Numbers that are none or
    infinite count as in `folded`. To be used with `wrapped` by lookups that reach farther than to
    the next texel.
    """
    if wrap == REPEAT:
        return folded(u, wrap)
    if wrap == MIRROR:
        u -= 2.0 * np.floor(0.5 * u)
        return u if u < 2.0 else 0.0
    return max(min(u, _FARTHEST), -_FARTHEST) if u == u else 0.0


@kernel
def wrapped(index, size, wrap):  # type: ignore[no-untyped-def]
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
    column = wrapped(column, width, wrap)
    row = wrapped(row, height, wrap)
    return row * width + column if column >= 0 and row >= 0 else OUTSIDE


@kernel
def _neighbors(x, size, wrap):  # type: ignore[no-untyped-def]
    """Texels to either side of a place along an axis, and how far between them it lies.

    `x` is 0 at the first center; beyond the edges it is `folded`, so that no division is needed.
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
def cell_at(u, v, width, height, wrap, first):  # type: ignore[no-untyped-def]
    """Four texels about a `folded` coordinate, and how far between them it lies.

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
def between(texels, cell, x, y, channel, outside):  # type: ignore[no-untyped-def]
    """Interpolate one channel between the four texels of a cell; exact where they are equal.

    Parameters
    ----------
    texels : (N, C) float32
    cell, x, y
        As from `cell_at`; the precision of the latter two is that of the result.
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


@kernel
def bilinear(image, u, v, wrap, out):  # type: ignore[no-untyped-def]
    """Interpolate the four texels about (u, v) into `out`; to be called from kernels.

    Parameters
    ----------
    image : (H, W, C) float32
        C-contiguous, with at least one texel.
    u, v : float64
        Texture coordinates, v up. Whatever they are, no texel outside the image is read; one that
        is not a number counts as 0, and so does an infinite one that repeats or is mirrored.
    wrap : int
        `REPEAT`, where the image tiles the plane; `MIRROR`, where every second tile is turned
        around; `CLAMP`, where its border texels go on; `BORDER`, where 0 lies around it.
    out : (C,) float32
        Written. An image that is constant gives exactly its constant.
    """
    height, width, n_channels = image.shape
    texels = image.reshape((height * width, n_channels))
    cell, x, y = cell_at(folded(u, wrap), folded(v, wrap), width, height, wrap, 0)
    for channel in range(n_channels):
        out[channel] = between(texels, cell, x, y, channel, np.float32(0.0))


@kernel
def _lookup_kernel(image, uvs, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    height, width, n_channels = image.shape
    texels = image.reshape((height * width, n_channels))
    for i in range(start, stop):
        u, v = folded(uvs[i, 0], wrap), folded(uvs[i, 1], wrap)
        cell, x, y = cell_at(u, v, width, height, wrap, 0)
        for channel in range(n_channels):
            out[i, channel] = between(texels, cell, x, y, channel, border[channel])


def lookup(
    image: npt.NDArray[Any],
    uvs: npt.NDArray[Any],
    *,
    wrap: str = "repeat",
    border: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Values of an image at texture coordinates, interpolated bilinearly with float64 weights.

    Parameters
    ----------
    image : (H, W, C) float32
        Linear values, row 0 at the top.
    uvs : (..., 2) float64
        Texture coordinates, v up.
    wrap
        What lies outside the unit square: "repeat", "mirror", "clamp" or "border".
    border : float or (C,), optional
        Values of the border; 0 if not given.
    threads
        None for every processor.

    Returns
    -------
    (..., C) float32

    Raises
    ------
    OptionError
        `wrap` is something else, the border does not fit the channels, or the image has no texel.
    """
    code = wrap_code(wrap)
    image = np.require(image, np.float32, "C")
    if image.ndim != 3 or image.size == 0:
        raise OptionError(f"image: the shape {image.shape} is not (height, width, channels)")
    uvs = np.asarray(uvs, dtype=np.float64)
    flat = np.ascontiguousarray(uvs.reshape(-1, 2))
    outside = border_values(border, image.shape[2])
    out = np.empty((len(flat), image.shape[2]), np.float32)

    def work(start: int, stop: int) -> None:
        _lookup_kernel(image, flat, code, outside, out, start, stop)

    run_bands(work, len(flat), band=_BAND, threads=threads)
    return out.reshape(*uvs.shape[:-1], image.shape[2])
