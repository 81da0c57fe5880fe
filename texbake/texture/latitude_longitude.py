"""Latitude-longitude images to cube maps and back.

The image shows all directions at once: its middle looks along -z, +x is to the right of that and
+y is up. With u from 0 at the left edge to 1 and v from 0 at the bottom to 1,

    u = atan2(x, -z) / 2 pi + 1/2,    v = asin(y) / pi + 1/2,

as an eye inside sees it that looks along -z, like a camera that has not been turned.

A texel of the result is the mean over all that it covers, weighted by solid angle: lookups are
spread over it, at most half a texel of the source apart, where values interpolated linearly have
next to nothing left that could alias. Toward the poles an image has ever more texels for ever
less of the sphere; there its rows are first averaged over as many as lie between two lookups.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for prefilter,
reconstruction and resampling; Debevec, "Rendering Synthetic Objects into Real Scenes", 1998, for
panoramas as light sources.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.cube_lookup import bilinear_in_cell, cell_of, face_coordinates
from texbake.texture.cube_map import FACE_AXES, CubeMap, without_gaps
from texbake.texture.lookup import row_of_v

# Lookups a band: some milliseconds of work.
_BAND = 1 << 17
_AXES = tuple(tuple(tuple(map(float, row)) for row in axes) for axes in FACE_AXES)


def from_latitude_longitude(
    image: npt.NDArray[Any], *, size: int | None = None, threads: int | None = None
) -> CubeMap:
    """Cube map of a latitude-longitude image.

    Parameters
    ----------
    image : (H, W, C) float32
        Linear, row 0 at the top; usually twice as wide as high. Values that are not finite
        count as 0.
    size
        Texels along one side of a face; None: a quarter of the width, at which both have about the
        same number of texels in a degree along the horizon.

    Returns
    -------
    CubeMap

    Raises
    ------
    OptionError
        The size is below 1, or the image has no texel.
    """
    pixels = np.require(image, np.float32, "C")
    if pixels.ndim != 3 or pixels.size == 0:
        raise OptionError(f"image: the shape {pixels.shape} is not (height, width, channels)")
    height, width, n_channels = pixels.shape
    size = max(width // 4, 1) if size is None else size
    if size < 1:
        raise OptionError(f"size: {size} is too small; it must be at least 1")
    # A texel in the middle of a face is the widest, with 2 / size radians.
    finest = min(2 * math.pi / width, math.pi / height)
    n_lookups = max(1, math.ceil(2.0 / size / (finest / 2)))
    rows = _with_wide_texels(without_gaps(pixels), 2.0 / size / n_lookups)
    out = np.empty((6, size, size, n_channels), np.float32)

    def work(start: int, stop: int) -> None:
        _to_cube_kernel(rows, n_lookups, out, start, stop)

    run_bands(work, 6 * size, band=max(1, _BAND // (size * n_lookups**2)), threads=threads)
    return CubeMap(out)


def to_latitude_longitude(
    cube: CubeMap, *, height: int | None = None, threads: int | None = None
) -> npt.NDArray[np.float32]:
    """Latitude-longitude image of a cube map.

    Parameters
    ----------
    cube
        The cube map.
    height
        Of the image, which is twice as wide; None: twice the size of the cube map.

    Returns
    -------
    (height, 2 height, C) float32

    Raises
    ------
    OptionError
        The height is below 1.
    """
    height = 2 * cube.size if height is None else height
    if height < 1:
        raise OptionError(f"height: {height} is too small; it must be at least 1")
    texels = cube.bordered.reshape(-1, cube.n_channels)
    # A texel in the middle of an edge, where faces are 1 / size radians a texel.
    n_lookups = max(1, math.ceil(math.pi / height / (0.5 / cube.size)))
    out = np.empty((height, 2 * height, cube.n_channels), np.float32)

    def work(start: int, stop: int) -> None:
        _to_image_kernel(texels, cube.size, n_lookups, out, start, stop)

    run_bands(work, height, band=max(1, _BAND // (2 * height * n_lookups**2)), threads=threads)
    return out


def _with_wide_texels(image: npt.NDArray[np.float32], width_rad: float) -> npt.NDArray[np.float32]:
    """Average rows of an image over at least `width_rad` radians along its circle of latitude.

    The mean of a row stays as it was; a row whose texels are as wide stays the same.
    """
    height, width, _ = image.shape
    out = image.copy()
    latitudes = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    widths = np.minimum(width_rad / np.cos(latitudes) * width / (2 * np.pi), width)
    centers = np.arange(width) + 0.5
    for row in np.flatnonzero(widths > 1.0):
        # The integral from the left edge on, and once around more, so that windows can reach over.
        whole = np.concatenate([image[row]] * 3).astype(np.float64)
        integral = np.concatenate([np.zeros((1, whole.shape[1])), np.cumsum(whole, axis=0)])
        ends = np.stack([centers - widths[row] / 2, centers + widths[row] / 2]) + width
        left = ends.astype(np.int64)
        at_ends = integral[left] + (ends - left)[..., None] * whole[left]
        out[row] = (at_ends[1] - at_ends[0]) / widths[row]
        # Differences of sums leave a rounding error, which a constant row shall not show.
        np.clip(out[row], image[row].min(axis=0), image[row].max(axis=0), out=out[row])
    return out


@kernel
def _add_from_image(image, x, y, z, weight, sums):  # type: ignore[no-untyped-def]
    """Add `weight` times the bilinear value in a unit direction to `sums` (C,).

    Beyond a pole lies the same row, half a turn away.
    """
    height, width, n_channels = image.shape
    column = (np.arctan2(x, -z) / (2 * np.pi) + 0.5) * width - 0.5
    row = row_of_v(np.arcsin(min(max(y, -1.0), 1.0)) / np.pi + 0.5, height) - 0.5
    above = int(np.floor(row))
    for corner in range(2):
        here = above + corner
        at = column
        if here < 0 or here >= height:
            here = min(max(here, 0), height - 1)
            at += 0.5 * width
        left = int(np.floor(at))
        along = at - left
        left %= width
        right = left + 1 if left + 1 < width else 0
        share = weight * (row - above if corner == 1 else 1.0 - (row - above))
        for channel in range(n_channels):
            first = np.float64(image[here, left, channel])
            sums[channel] += share * (first + along * (image[here, right, channel] - first))


@kernel
def _to_cube_kernel(image, n_lookups, out, start, stop):  # type: ignore[no-untyped-def]
    size = out.shape[1]
    sums = np.zeros(out.shape[3])
    step = 2.0 / (size * n_lookups)
    for index in range(start, stop):
        face = index // size
        row = index % size
        axes = _AXES[face]
        for column in range(size):
            sums[:] = 0.0
            total = 0.0
            for i in range(n_lookups * n_lookups):
                s = (column * n_lookups + i % n_lookups + 0.5) * step - 1.0
                t = (row * n_lookups + i // n_lookups + 0.5) * step - 1.0
                shrink = 1.0 / np.sqrt(1.0 + s * s + t * t)
                # The solid angle of a piece of the face falls with the cube of its distance.
                weight = shrink * shrink * shrink
                x = (s * axes[0][0] + t * axes[1][0] + axes[2][0]) * shrink
                y = (s * axes[0][1] + t * axes[1][1] + axes[2][1]) * shrink
                z = (s * axes[0][2] + t * axes[1][2] + axes[2][2]) * shrink
                _add_from_image(image, x, y, z, weight, sums)
                total += weight
            for channel in range(len(sums)):
                out[face, row, column, channel] = sums[channel] / total


@kernel
def _to_image_kernel(texels, size, n_lookups, out, start, stop):  # type: ignore[no-untyped-def]
    height, width, n_channels = out.shape
    sums = np.zeros(n_channels)
    for row in range(start, stop):
        # Toward the poles texels are narrower, and need fewer lookups across.
        middle = (0.5 - (row + 0.5) / height) * np.pi
        n_across = max(1, int(np.ceil(n_lookups * np.cos(middle))))
        for column in range(width):
            sums[:] = 0.0
            total = 0.0
            for i in range(n_lookups):
                latitude = (row_of_v((row + (i + 0.5) / n_lookups) / height, 1.0) - 0.5) * np.pi
                weight = np.cos(latitude)
                y = np.sin(latitude)
                for j in range(n_across):
                    longitude = ((column + (j + 0.5) / n_across) / width - 0.5) * 2 * np.pi
                    face, s, t = face_coordinates(
                        weight * np.sin(longitude), y, -weight * np.cos(longitude)
                    )
                    first, stride, along_x, along_y = cell_of(0, size, face, s, t)
                    for channel in range(n_channels):
                        value = bilinear_in_cell(texels, first, stride, along_x, along_y, channel)
                        sums[channel] += weight * value
                    total += weight
            for channel in range(n_channels):
                out[row, column, channel] = sums[channel] / total
