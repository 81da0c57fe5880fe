"""Values between texels, and the one place where v up becomes rows down.

A texture coordinate (u, v) has v up and (0, 0) at the lower left corner of the image; row 0 of an
image is its top. In texels, the continuous coordinates (x, y) have y down from the top edge, and
the center of the texel in column i and row j is (i + 0.5, j + 0.5).

`row_of_v` and `bilinear` can be called from the kernels of other modules.

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
_WRAPS = {"repeat": REPEAT, "clamp": CLAMP}

# Lookups a band: some milliseconds of work.
_BAND = 1 << 18


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
    return np.stack([uvs[..., 0] * width, row_of_v.py_func(uvs[..., 1], height)], axis=-1)


@kernel
def bilinear(image, u, v, wrap, out):  # type: ignore[no-untyped-def]
    """Interpolate the four texels about (u, v) into `out`; to be called from kernels.

    Parameters
    ----------
    image : (H, W, C) float32
        At least one texel.
    u, v : float64
        Texture coordinates, v up. Whatever they are, no texel outside the image is read; one that
        is not a number counts as 0, and so does an infinite one that repeats.
    wrap : int
        `REPEAT`, where the image tiles the plane, or `CLAMP`, where its border texels go on.
    out : (C,) float32
        Written. An image that is constant gives exactly its constant.
    """
    height, width, n_channels = image.shape
    if wrap == REPEAT:
        u -= np.floor(u)
        v -= np.floor(v)
        # Not a number, or 1 left over from a negative number too small to subtract from 1.
        if not u < 1.0:
            u = 0.0
        if not v < 1.0:
            v = 0.0
    else:
        u = min(u, 1.0) if u > 0.0 else 0.0
        v = min(v, 1.0) if v > 0.0 else 0.0
    x = u * width - 0.5
    y = row_of_v(v, height) - 0.5
    left = int(np.floor(x))
    top = int(np.floor(y))
    along_x = x - left
    along_y = y - top
    right = left + 1
    bottom = top + 1
    if wrap == REPEAT:
        left = left if left >= 0 else width - 1
        top = top if top >= 0 else height - 1
        right = right if right < width else 0
        bottom = bottom if bottom < height else 0
    else:
        left = max(left, 0)
        top = max(top, 0)
        right = min(right, width - 1)
        bottom = min(bottom, height - 1)
        left = min(left, right)
        top = min(top, bottom)
    for channel in range(n_channels):
        above_left = np.float64(image[top, left, channel])
        below_left = np.float64(image[bottom, left, channel])
        above = above_left + along_x * (image[top, right, channel] - above_left)
        below = below_left + along_x * (image[bottom, right, channel] - below_left)
        out[channel] = above + along_y * (below - above)


@kernel
def _lookup_kernel(image, uvs, wrap, out, start, stop):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        bilinear(image, uvs[i, 0], uvs[i, 1], wrap, out[i])


def lookup(
    image: npt.NDArray[Any],
    uvs: npt.NDArray[Any],
    *,
    wrap: str = "repeat",
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Values of an image at texture coordinates, interpolated bilinearly.

    Parameters
    ----------
    image : (H, W, C) float32
        Linear values, row 0 at the top.
    uvs : (..., 2) float64
        Texture coordinates, v up.
    wrap
        "repeat" or "clamp": what lies outside the unit square.
    threads
        None for every processor.

    Returns
    -------
    (..., C) float32

    Raises
    ------
    OptionError
        `wrap` is something else, or the image has no texel.
    """
    if wrap not in _WRAPS:
        raise OptionError(f"wrap: {wrap!r} is not known; it is one of {', '.join(_WRAPS)}")
    image = np.require(image, np.float32, "C")
    if image.ndim != 3 or image.size == 0:
        raise OptionError(f"image: the shape {image.shape} is not (height, width, channels)")
    uvs = np.asarray(uvs, dtype=np.float64)
    flat = np.ascontiguousarray(uvs.reshape(-1, 2))
    out = np.empty((len(flat), image.shape[2]), np.float32)

    def work(start: int, stop: int) -> None:
        _lookup_kernel(image, flat, _WRAPS[wrap], out, start, stop)

    run_bands(work, len(flat), band=_BAND, threads=threads)
    return out.reshape(*uvs.shape[:-1], image.shape[2])
