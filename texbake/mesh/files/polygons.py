"""Polygons cut into triangles, as mesh files that hold polygons need it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def fan_corners(sizes: npt.NDArray[Any]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Corners of the triangles that fan out from each polygon's first corner.

    Parameters
    ----------
    sizes : (P,) integers
        Corners of each polygon, whose corners are numbered on from those of the one before.

    Returns
    -------
    corners : (F, 3) int64
        Corner numbers. A polygon of n corners gives n - 2 triangles in the order of its corners;
        one of fewer than three gives none.
    polygons : (F,) int64
        The polygon of each triangle.

    Examples
    --------
    >>> fan_corners(np.array([3, 4]))[0].tolist()
    [[0, 1, 2], [3, 4, 5], [3, 5, 6]]
    """
    sizes = sizes.astype(np.int64)
    n_triangles = np.maximum(sizes - 2, 0)
    polygons = np.repeat(np.arange(len(sizes)), n_triangles)
    first_corners = (np.cumsum(sizes) - sizes)[polygons]
    first_triangles = (np.cumsum(n_triangles) - n_triangles)[polygons]
    seconds = first_corners + np.arange(len(polygons)) - first_triangles + 1
    return np.stack([first_corners, seconds, seconds + 1], axis=1), polygons
