"""Values of a cube map in directions.

`face_coordinates`, `cell_of` and `bilinear_in_cell` can be called from the kernels of other
modules; they read the bordered faces of a `CubeChain`.

Based on: the OpenGL 4.6 specification, sections 8.13 and 8.14. Departs from it in that a direction
that is 0 or not finite, for which there is no face, has the value 0 in every channel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.cube_chain import CubeChain, reduced
from texbake.texture.cube_map import CubeMap, texel_directions

_MODES = {"nearest": 0, "bilinear": 1, "trilinear": 2}
CUBE_FILTERS = tuple(_MODES)
_TRILINEAR = _MODES["trilinear"]
_NEAREST = _MODES["nearest"]

# Directions a band: some milliseconds of work.
_BAND = 1 << 16


@kernel
def face_coordinates(x, y, z):  # type: ignore[no-untyped-def]
    """Face (0 to 5; -1: none), s and t in [0, 1] of a direction of any length.

    The same as `cube_map.locate`, without its table.
    """
    size_x = abs(x)
    size_y = abs(y)
    size_z = abs(z)
    if size_x >= size_y and size_x >= size_z:
        largest = size_x
        face = 0 if x > 0.0 else 1
        s = -z if x > 0.0 else z
        t = -y
    elif size_y >= size_z:
        largest = size_y
        face = 2 if y > 0.0 else 3
        s = x
        t = z if y > 0.0 else -z
    else:
        largest = size_z
        face = 4 if z > 0.0 else 5
        s = x if z > 0.0 else -x
        t = -y
    half = 0.5 / largest
    s = s * half + 0.5
    t = t * half + 0.5
    # None of these holds for what is not a number; `half` is 0 where the largest is infinite.
    if half > 0.0 and s >= -1.0 and t >= -1.0:
        # Rounding can lead beyond an edge.
        return face, min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
    return -1, 0.0, 0.0


@kernel
def cell_of(offset, size, face, s, t):  # type: ignore[no-untyped-def]
    """Find the four texels about (s, t).

    Returns the index of the first, the texels a row has, and how far along x and y it lies.
    """
    stride = size + 2
    x = s * size + 0.5
    y = t * size + 0.5
    left = int(x)
    top = int(y)
    first = offset + (face * stride + top) * stride + left
    return first, stride, np.float32(x - left), np.float32(y - top)


@kernel
def bilinear_in_cell(texels, first, stride, along_x, along_y, channel):  # type: ignore[no-untyped-def]
    """Interpolate one channel; exact where the four texels are equal."""
    above = texels[first, channel]
    below = texels[first + stride, channel]
    above += along_x * (texels[first + 1, channel] - above)
    below += along_x * (texels[first + stride + 1, channel] - below)
    return above + along_y * (below - above)


@kernel
def _sample_kernel(texels, offsets, sizes, directions, levels, mode, out, start, stop):  # type: ignore[no-untyped-def]
    n_channels = texels.shape[1]
    last = np.float64(len(sizes) - 1)
    for i in range(start, stop):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        face, s, t = face_coordinates(np.float64(x), np.float64(y), np.float64(z))
        if face < 0:
            for channel in range(n_channels):
                out[i, channel] = 0.0
            continue
        level = np.float64(0.0)
        if len(levels) > 0 and levels[i] > 0.0:
            level = min(np.float64(levels[i]), last)
        if mode != _TRILINEAR:
            level = np.floor(level + 0.5)
        fine = int(level)
        if mode == _NEAREST:
            size = sizes[fine]
            row = face * (size + 2) + min(int(t * size), size - 1) + 1
            index = offsets[fine] + row * (size + 2) + min(int(s * size), size - 1) + 1
            for channel in range(n_channels):
                out[i, channel] = texels[index, channel]
            continue
        first, stride, along_x, along_y = cell_of(offsets[fine], sizes[fine], face, s, t)
        for channel in range(n_channels):
            out[i, channel] = bilinear_in_cell(texels, first, stride, along_x, along_y, channel)
        blend = np.float32(level - fine)
        if blend > 0.0:
            first, stride, along_x, along_y = cell_of(
                offsets[fine + 1], sizes[fine + 1], face, s, t
            )
            for channel in range(n_channels):
                value = bilinear_in_cell(texels, first, stride, along_x, along_y, channel)
                out[i, channel] += blend * (value - out[i, channel])


def sample_cube(
    cube: CubeMap | CubeChain,
    directions: npt.NDArray[Any],
    levels: npt.NDArray[Any] | None = None,
    *,
    filter: str = "bilinear",  # noqa: A002  # what the field calls it
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Values of a cube map in directions, without a seam at edges and corners of its faces.

    Parameters
    ----------
    cube : CubeMap or CubeChain
    directions : (n, 3) float32
        In world space, of any length. One that is 0 or not finite gets 0 in every channel.
    levels : (n,) float32, optional
        Level to read, 0 the finest, clamped to those there are; none or not a number: 0.
    filter
        `nearest` and `bilinear` read the level that is nearest, `trilinear` the two about it.
    threads
        None for every processor.

    Returns
    -------
    (n, C) float32

    Raises
    ------
    OptionError
        The filter is something else, or an array has another shape.

    Examples
    --------
    >>> cube = CubeMap(np.arange(6, dtype=np.float32).reshape(6, 1, 1, 1))
    >>> sample_cube(cube, np.array([[-2.0, 0.0, 0.0], [0.0, 0.0, 1.0]])).ravel().tolist()
    [1.0, 4.0]
    """
    if filter not in _MODES:
        raise OptionError(f"filter: {filter!r} is not known; it is one of {', '.join(_MODES)}")
    if isinstance(cube, CubeMap):
        texels = cube.bordered.reshape(-1, cube.n_channels)
        offsets, sizes = _only(0), _only(cube.size)
    else:
        texels, offsets, sizes = cube.texels, cube.offsets, cube.sizes
    directions = _readable(directions)
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise OptionError(f"directions: the shape {directions.shape} is not (n, 3)")
    wanted = _readable(() if levels is None else levels)
    if levels is not None and wanted.shape != directions.shape[:1]:
        raise OptionError(f"levels: the shape {wanted.shape} is not ({len(directions)},)")
    out = np.empty((len(directions), cube.n_channels), np.float32)
    mode = _MODES[filter]

    def work(start: int, stop: int) -> None:
        _sample_kernel(texels, offsets, sizes, directions, wanted, mode, out, start, stop)

    run_bands(work, len(directions), band=_BAND, threads=threads)
    return out


def resized(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
    """Cube map of another size: `reduced` to fewer texels, or interpolated to more.

    Raises
    ------
    OptionError
        The size is below 1.
    """
    if size <= cube.size:
        return reduced(cube, size, threads=threads)
    directions = texel_directions(size).reshape(-1, 3)
    return CubeMap(sample_cube(cube, directions, threads=threads).reshape(6, size, size, -1))


def _only(number: int) -> npt.NDArray[np.int64]:
    """Return an array of one number, read-only as those of a chain are."""
    array = np.array([number], np.int64)
    array.flags.writeable = False
    return array


def _readable(values: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return values as contiguous float32, read-only, so that the kernel has one signature."""
    array = np.require(values, np.float32, "C").view()
    array.flags.writeable = False
    return array
