"""Faces that lie on one another in the texture.

Two convex shapes do not overlap if a line along some edge of one of them parts them. Pairs to try
come from a grid of about as many cells as there are faces.

Based on: Gottschalk, Lin, Manocha, "OBBTree", 1996 (the separating axis theorem).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.mesh.mesh import FloatArray

# Depth of an overlap, as a share of the texture, that is not one: what float32, or the six
# decimals of many files, leave of coordinates on both sides of an edge.
_DEPTH = 1e-6


def overlapping_faces(corners: FloatArray) -> npt.NDArray[np.bool_]:
    """Find the faces that cover, in the texture, something that another face covers too.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Texture coordinates of the corners.

    Returns
    -------
    (F,) bool
        False for faces that share an edge or a corner but no area, and for faces without area.

    Examples
    --------
    >>> square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    >>> overlapping_faces(square)
    array([False, False])
    >>> overlapping_faces(square - [[[0, 0]], [[0, 0.1]]])
    array([ True,  True])
    """
    corners = np.ascontiguousarray(corners, dtype=np.float64)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    n_cells = max(1, min(int(math.sqrt(len(corners))), 1024))
    scales = np.where(high > low, n_cells / np.where(high > low, high - low, 1.0), 0.0)
    cells = np.minimum(((corners - low) * scales).astype(np.int64), n_cells - 1)
    boxes = np.concatenate([cells.min(axis=1), cells.max(axis=1)], axis=1)
    overlapping = np.zeros(len(corners), dtype=np.bool_)
    _overlap_kernel(corners, boxes, n_cells, _DEPTH, overlapping)
    return overlapping


@njit(nogil=True, cache=True)
def _overlap_kernel(corners, boxes, n_cells, depth, overlapping):  # type: ignore[no-untyped-def]
    """Try all pairs of faces that are listed in one cell of the grid."""
    ends = np.zeros(n_cells * n_cells, dtype=np.int64)
    for box in boxes:
        for row in range(box[1], box[3] + 1):
            ends[row * n_cells + box[0] : row * n_cells + box[2] + 1] += 1
    ends = np.cumsum(ends)
    listed = np.empty(ends[-1], dtype=np.int64)
    starts = ends.copy()
    for face in range(len(boxes)):
        box = boxes[face]
        for row in range(box[1], box[3] + 1):
            for cell in range(row * n_cells + box[0], row * n_cells + box[2] + 1):
                starts[cell] -= 1
                listed[starts[cell]] = face
    for cell in range(len(ends)):
        for i in range(starts[cell], ends[cell]):
            for j in range(starts[cell], i):
                one, other = listed[i], listed[j]
                if overlapping[one] and overlapping[other]:
                    continue
                if not (
                    _parts(corners[one], corners[other], depth)
                    or _parts(corners[other], corners[one], depth)
                ):
                    overlapping[one] = overlapping[other] = True


@njit(nogil=True, cache=True)
def _parts(one, other, depth):  # type: ignore[no-untyped-def]
    """Whether an edge of `one` has all of `other` beyond it; so has a face thinner than `depth`."""
    for i in range(3):
        x, y = one[i]
        dx, dy = one[(i + 1) % 3, 0] - x, one[(i + 1) % 3, 1] - y
        allowed = depth * math.sqrt(dx * dx + dy * dy)
        # Twice the signed areas over the edge: distances from it times its length.
        inside = dx * (one[(i + 2) % 3, 1] - y) - dy * (one[(i + 2) % 3, 0] - x)
        if abs(inside) <= allowed:
            return True
        side = 1.0 if inside > 0.0 else -1.0
        deepest = -np.inf
        for corner in range(3):
            over = dx * (other[corner, 1] - y) - dy * (other[corner, 0] - x)
            deepest = max(deepest, side * over)
        if deepest <= allowed:
            return True
    return False
