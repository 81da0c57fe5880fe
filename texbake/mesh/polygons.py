"""Triangles of polygons.

The triangles of a polygon depend on its shape alone, not on the corner that the file begins with. A
quadrilateral is cut along its shorter diagonal, or along the only one that lies inside; where both
are equally long but for rounding, along that of the vertex with the least number. Polygons of more
corners lose one ear after the other, those with short diagonals first. All decisions on sides are
exact, in the plane of the two axes that are farthest from the polygon's normal.

Kernel: `core/ear_clipping.c`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import warn_of
from texbake.files import PathLike
from texbake.parallel import run_bands

Indices = npt.NDArray[np.int64]

_BAND = 1 << 14  # polygons


def polygon_of_triangles(sizes: npt.NDArray[Any]) -> Indices:
    """(F,) the polygon of each triangle: a polygon of n corners has n - 2, none if n < 3."""
    return np.repeat(np.arange(len(sizes)), np.maximum(sizes.astype(np.int64) - 2, 0))


def triangulated(
    path: PathLike,
    positions: npt.NDArray[np.float64],
    vertices: npt.NDArray[Any],
    sizes: npt.NDArray[Any],
) -> tuple[Indices, Indices]:
    """Cut the polygons of a file into triangles; warn of those left out, and of crossing ones.

    Parameters
    ----------
    path
        The file, for warnings.
    positions : (V, 3) float64
    vertices : (C,) integers
        Vertex of each corner. Polygons with one that is out of range are fanned out.
    sizes : (P,) integers
        Corners of each polygon, whose corners are numbered on from those of the one before.

    Returns
    -------
    corners : (F, 3) int64
        Corner numbers, n - 2 triangles for a polygon of n corners, in the order of the polygons.
        The first triangle begins with the polygon's first two corners.
    polygons : (F,) int64
        The polygon of each triangle.

    Notes
    -----
    The triangles of a simple polygon do not overlap in its projection and fill it. Straight corners
    stay corners of triangles with area where the polygon allows that. Those of a polygon that
    crosses itself overlap or fold.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]])
    >>> triangulated("", corners, np.arange(4), np.array([4]))[0].tolist()
    [[0, 1, 2], [0, 2, 3]]
    """
    sizes = sizes.astype(np.int64)
    polygons = polygon_of_triangles(sizes)
    first_corners = np.cumsum(sizes) - sizes
    triangles = np.empty((len(polygons), 3), np.int64)
    if (sizes == 3).all():
        return np.arange(len(vertices)).reshape(-1, 3), polygons
    if n_short := np.count_nonzero(sizes < 3):
        noun = "face" if n_short == 1 else "faces"
        warn_of(path, f"left out {n_short:,} {noun} with fewer than three corners")
    is_crossed = np.zeros(len(sizes), np.bool_)
    known = np.clip(vertices, 0, len(positions) - 1).astype(np.int32)
    n_triangles = np.maximum(sizes - 2, 0)
    first_triangles = np.cumsum(n_triangles) - n_triangles
    run_bands(
        lambda start, stop: core.triangulate_polygons(
            positions, known, first_corners, sizes, first_triangles, triangles, is_crossed,
            start, stop,
        ),
        len(sizes),
        band=_BAND,
    )  # fmt: skip
    if n_crossed := np.count_nonzero(is_crossed):
        noun = "face crosses itself" if n_crossed == 1 else "faces cross themselves"
        warn_of(path, f"{n_crossed:,} {noun}; the triangles overlap or fold there")
    return triangles, polygons
