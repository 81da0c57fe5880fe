"""Sample cube maps by direction, and convert them from and to latitude-longitude images.

A latitude-longitude image shows all directions at once: its center looks along -z, +x is to the
right of it and +y is up. With u from 0 at the left edge to 1 and v from 0 at the bottom to 1,

    u = atan2(x, -z) / 2 pi + 1/2,    v = asin(y) / pi + 1/2,

as seen from inside by a camera that looks along -z.

Each texel of a converted image is the mean of the area that it covers, weighted by solid angle.
Lookups are spread over that area, at most half a texel of the source apart. Toward the poles of a
latitude-longitude image, more and more texels cover less and less of the sphere. There, each row is
first averaged over the texels that lie between two lookups.

Directions that are zero or not finite belong to no face and give 0 in every channel. Kernel, which
names the sources: `core/cube_maps.c`.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, require_known, require_least
from texbake.mesh.mesh import Float32Array
from texbake.parallel import run_bands
from texbake.texture.cube_map import CubeChain, CubeMap, shrink_cube, texel_directions, without_gaps
from texbake.texture.lookup import require_image

# As in `core/cube_maps.c`.
CUBE_FILTER_CODES = {"nearest": 0, "bilinear": 1, "trilinear": 2}
CUBE_FILTERS = tuple(CUBE_FILTER_CODES)

# Directions per band: a few milliseconds of work.
_BAND = 1 << 16


def sample_cube(
    cube: CubeMap | CubeChain,
    directions: npt.NDArray[Any],
    levels: npt.NDArray[Any] | None = None,
    *,
    filter: str = "bilinear",  # noqa: A002  # what the field calls it
    threads: int | None = None,
) -> Float32Array:
    """(n, C) values of a cube map in directions (n, 3), without seams, at levels (n,)."""
    require_known("filter", filter, CUBE_FILTERS)
    if isinstance(cube, CubeMap):
        texels = cube.bordered.reshape(-1, cube.n_channels)
        offsets, sizes = np.zeros(1, np.int64), np.full(1, cube.size, np.int64)
    else:
        texels, offsets, sizes = cube.texels, cube.offsets, cube.sizes
    directions = np.require(directions, np.float32, ["C", "A"])
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise OptionError(f"directions: the shape {directions.shape} is not (n, 3)")
    wanted = None if levels is None else np.require(levels, np.float32, ["C", "A"])
    if wanted is not None and wanted.shape != directions.shape[:1]:
        raise OptionError(f"levels: the shape {wanted.shape} is not ({len(directions)},)")
    out = np.empty((len(directions), cube.n_channels), np.float32)
    mode = CUBE_FILTER_CODES[filter]
    work = partial(core.sample_cube, texels, offsets, sizes, directions, wanted, mode, out)
    run_bands(work, len(directions), band=_BAND, threads=threads)
    return out


def resize_cube(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
    """Resize a cube map: with `shrink_cube` to fewer texels, by interpolation to more."""
    if size <= cube.size:
        return shrink_cube(cube, size, threads=threads)
    directions = texel_directions(size).reshape(-1, 3)
    return CubeMap(sample_cube(cube, directions, threads=threads).reshape(6, size, size, -1))


# Lookups per band: a few milliseconds of work.
_LATITUDE_BAND = 1 << 17


def from_latitude_longitude(
    image: npt.NDArray[Any], *, size: int | None = None, threads: int | None = None
) -> CubeMap:
    """Cube map with faces of `size` texels of a linear (H, W, C) image, row 0 at the top."""
    pixels = require_image(image)
    height, width, n_channels = pixels.shape
    size = max(width // 4, 1) if size is None else size
    require_least("size", size)
    # Texels at the center of a face are the widest: 2 / size radians.
    finest = min(2 * math.pi / width, math.pi / height)
    n_lookups = max(1, math.ceil(2.0 / size / (finest / 2)))
    rows = _with_wide_texels(without_gaps(pixels), 2.0 / size / n_lookups)
    out = np.empty((6, size, size, n_channels), np.float32)
    work = partial(core.convert_to_cube, rows, n_lookups, out)
    run_bands(work, 6 * size, band=max(1, _LATITUDE_BAND // (size * n_lookups**2)), threads=threads)
    return CubeMap(out)


def to_latitude_longitude(
    cube: CubeMap, *, height: int | None = None, threads: int | None = None
) -> Float32Array:
    """(height, 2 height, C) latitude-longitude image of a cube map."""
    height = 2 * cube.size if height is None else height
    require_least("height", height)
    texels = cube.bordered.reshape(-1, cube.n_channels)
    # Texels in the middle of an edge of a face are 1 / size radians wide.
    n_lookups = max(1, math.ceil(math.pi / height / (0.5 / cube.size)))
    out = np.empty((height, 2 * height, cube.n_channels), np.float32)
    work = partial(core.convert_from_cube, texels, cube.size, n_lookups, out)
    run_bands(
        work, height, band=max(1, _LATITUDE_BAND // (2 * height * n_lookups**2)), threads=threads
    )
    return out


def _with_wide_texels(image: Float32Array, width_rad: float) -> Float32Array:
    """Average rows over at least `width_rad` along their circle of latitude, keeping means."""
    height, width, _ = image.shape
    out = image.copy()
    latitudes = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    widths = np.minimum(width_rad / pm.cos(latitudes) * width / (2 * np.pi), width)
    centers = np.arange(width) + 0.5
    for row in np.flatnonzero(widths > 1.0):
        # The integral from the left edge over two turns, so that windows can cross the right edge.
        whole = np.concatenate([image[row]] * 3).astype(np.float64)
        integral = np.concatenate([np.zeros((1, whole.shape[1])), np.cumsum(whole, axis=0)])
        ends = np.stack([centers - widths[row] / 2, centers + widths[row] / 2]) + width
        left = ends.astype(np.int64)
        at_ends = integral[left] + (ends - left)[..., None] * whole[left]
        out[row] = (at_ends[1] - at_ends[0]) / widths[row]
        # Differences of sums have a rounding error, which a constant row must not show.
        np.clip(out[row], image[row].min(axis=0), image[row].max(axis=0), out=out[row])
    return out
