"""Three-dimensional textures: values at points of a block.

A volume is a pile of images: slice k holds what lies at (s, t, r) with r from k / depth to
(k + 1) / depth, and its rows go down from the top as those of any image do, while t goes up.

Based on: Peachey, "Solid Texturing of Complex Surfaces", 1985; the OpenGL 4.6 specification,
section 8.14. Departs from the latter in the direction of rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.lookup import (
    OUTSIDE,
    between,
    border_values,
    reduced,
    row_of_v,
    texel_at,
    wrap_code,
    wrapped,
)

VOLUME_FILTERS = ("nearest", "trilinear")

# Lookups a band: some milliseconds of work.
_BAND = 1 << 17


@kernel
def _texel(column, row, layer, sizes, wrap):  # type: ignore[no-untyped-def]
    """Index of the texel that stands anywhere; OUTSIDE for the border."""
    depth, height, width = sizes
    layer = wrapped(layer, depth, wrap)
    index = texel_at(column, row, width, height, wrap)
    return layer * height * width + index if layer >= 0 and index >= 0 else OUTSIDE


@kernel
def _cell(left, top, layer, sizes, wrap):  # type: ignore[no-untyped-def]
    """Four texels of a slice, as `between` takes them."""
    return (
        _texel(left, top, layer, sizes, wrap),
        _texel(left + 1, top, layer, sizes, wrap),
        _texel(left, top + 1, layer, sizes, wrap),
        _texel(left + 1, top + 1, layer, sizes, wrap),
    )


@kernel
def _volume_kernel(volume, points, nearest, wrap, border, out, start, stop):  # type: ignore[no-untyped-def]
    depth, height, width, n_channels = volume.shape
    sizes = depth, height, width
    texels = volume.reshape((depth * height * width, n_channels))
    for i in range(start, stop):
        x = reduced(points[i, 0], wrap) * width
        y = row_of_v(reduced(points[i, 1], wrap), height)
        z = reduced(points[i, 2], wrap) * depth
        if nearest:
            # A texel holds its left, its lower and its front side, as in an image.
            index = _texel(int(np.floor(x)), int(np.ceil(y)) - 1, int(np.floor(z)), sizes, wrap)
            for channel in range(n_channels):
                out[i, channel] = texels[index, channel] if index >= 0 else border[channel]
            continue
        left, top, front = int(np.floor(x - 0.5)), int(np.floor(y - 0.5)), int(np.floor(z - 0.5))
        along_x = np.float32(x - 0.5 - left)
        along_y = np.float32(y - 0.5 - top)
        along_z = np.float32(z - 0.5 - front)
        cell = _cell(left, top, front, sizes, wrap)
        behind = _cell(left, top, front + 1, sizes, wrap)
        for channel in range(n_channels):
            near = between(texels, cell, along_x, along_y, channel, border[channel])
            far = between(texels, behind, along_x, along_y, channel, border[channel])
            out[i, channel] = near + along_z * (far - near)


def volume_lookup(
    volume: npt.NDArray[Any],
    points: npt.NDArray[Any],
    *,
    wrap: str = "repeat",
    filter: str = "trilinear",  # noqa: A002  # what the field calls it
    border: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Values of a volume at points.

    Parameters
    ----------
    volume : (D, H, W, C) float32
        Slices of growing r, their rows from the top.
    points : (n, 3) float64
        (s, t, r), the volume in the unit cube, t up. Whatever they are, nothing outside is read;
        what is not a number counts as 0, and so does what is infinite and repeats or is mirrored.
    wrap
        What lies outside the cube: "repeat", "mirror", "clamp" or "border".
    filter
        "nearest", or "trilinear": between the eight texels about a point.
    border : float or (C,), optional
        Values of the border; 0 if not given.
    threads
        None for every processor.

    Returns
    -------
    (n, C) float32
        Of a constant volume, exactly the constant, wherever no border is read.

    Raises
    ------
    OptionError
        An option is unknown or an array has another shape.
    """
    code = wrap_code(wrap)
    if filter not in VOLUME_FILTERS:
        raise OptionError(
            f"filter: {filter!r} is not known; it is one of {', '.join(VOLUME_FILTERS)}"
        )
    volume = np.require(volume, np.float32, "C")
    if volume.ndim != 4 or volume.size == 0:
        raise OptionError(
            f"volume: the shape {volume.shape} is not (depth, height, width, channels)"
        )
    points = np.require(points, np.float64, "C")
    if points.ndim != 2 or points.shape[1] != 3:
        raise OptionError(f"points: the shape {points.shape} is not (n, 3)")
    volume, points = volume.view(), points.view()
    volume.flags.writeable = points.flags.writeable = False  # one signature for the kernel
    outside = border_values(border, volume.shape[3])
    out = np.empty((len(points), volume.shape[3]), np.float32)
    nearest = filter == "nearest"

    def work(start: int, stop: int) -> None:
        _volume_kernel(volume, points, nearest, code, outside, out, start, stop)

    run_bands(work, len(points), band=_BAND, threads=threads)
    return out
