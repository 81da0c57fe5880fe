"""Faces that lie on one another in the texture.

Two convex shapes do not overlap if a line along some edge of one of them parts them. Pairs to try
come from a grid of about as many cells as there are faces.

Based on: Gottschalk, Lin, Manocha, "OBBTree", 1996 (the separating axis theorem).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray

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
    everything = np.array([0, len(corners)], dtype=np.int64)
    overlapping, _ = _overlaps(corners, np.arange(len(corners)), everything, _DEPTH, layered=False)
    return overlapping


def overlap_layers(corners: FloatArray, charts: IntArray, *, depth: float) -> IntArray:
    """Spread the faces of each chart over as few layers as it takes for none to overlap in one.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Coordinates of the corners.
    charts : (F,) int32
        Chart of each face; faces of different charts do not mind each other.
    depth : float
        Depth of an overlap that is not one, in the unit of `corners`.

    Returns
    -------
    (F,) int32
        0 for every face of a chart without overlaps. A face takes the lowest layer that the faces
        before it leave free.
    """
    order = np.argsort(charts, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(charts))]).astype(np.int64)
    _, layers = _overlaps(corners, order, starts, depth, layered=True)
    return layers


def _overlaps(
    corners: FloatArray,
    order: npt.NDArray[np.int64],
    starts: npt.NDArray[np.int64],
    depth: float,
    *,
    layered: bool,
) -> tuple[npt.NDArray[np.bool_], IntArray]:
    overlapping = np.zeros(len(corners), dtype=np.bool_)
    layers = np.zeros(len(corners), dtype=np.int32)
    _overlap_kernel(
        np.ascontiguousarray(corners, dtype=np.float64),
        order,
        starts,
        depth,
        layered,
        overlapping,
        layers,
    )
    return overlapping, layers


@kernel
def _overlap_kernel(corners, order, starts, depth, layered, overlapping, layers):  # type: ignore[no-untyped-def]
    """Compare each face with those before it of its group, which is order[starts[i]:starts[i + 1]].

    Each cell of a grid over the group keeps a chain of the faces whose bounding boxes touch it.
    Without `layered`, pairs that are both known to overlap something are not looked at again.
    """
    taken = np.full(len(corners) + 1, -1, dtype=np.int64)  # the last face that found a layer taken
    for group in range(len(starts) - 1):
        faces = order[starts[group] : starts[group + 1]]
        if len(faces) < 2:
            continue
        boxes, n_cells = _cell_boxes(corners, faces)
        heads = np.full(n_cells * n_cells, -1, dtype=np.int64)
        n_links = 0
        for box in boxes:
            n_links += (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
        links = np.empty((n_links, 2), dtype=np.int64)  # (face, next link)
        n_links = 0
        for i in range(len(faces)):
            face = faces[i]
            for row in range(boxes[i, 1], boxes[i, 3] + 1):
                for cell in range(row * n_cells + boxes[i, 0], row * n_cells + boxes[i, 2] + 1):
                    link = heads[cell]
                    links[n_links, 0], links[n_links, 1] = face, link
                    heads[cell] = n_links
                    n_links += 1
                    while link >= 0:
                        other, link = links[link, 0], links[link, 1]
                        known = overlapping[face] and overlapping[other]
                        if (layered or not known) and _overlap(
                            corners[face], corners[other], depth
                        ):
                            overlapping[face] = overlapping[other] = True
                            taken[layers[other]] = face
            while taken[layers[face]] == face:
                layers[face] += 1


@kernel
def _cell_boxes(corners, faces):  # type: ignore[no-untyped-def]
    """Cells of a square grid that the bounding boxes of faces touch; cells along its side."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for face in faces:
        for axis in range(2):
            low[axis] = min(low[axis], corners[face, :, axis].min())
            high[axis] = max(high[axis], corners[face, :, axis].max())
    n_cells = max(1, min(int(math.sqrt(len(faces))), 1024))
    boxes = np.empty((len(faces), 4), dtype=np.int64)
    for axis in range(2):
        extent = high[axis] - low[axis]
        scale = n_cells / extent if extent > 0.0 else 0.0
        for i in range(len(faces)):
            first = (corners[faces[i], :, axis].min() - low[axis]) * scale
            last = (corners[faces[i], :, axis].max() - low[axis]) * scale
            boxes[i, axis] = min(int(first), n_cells - 1)
            boxes[i, 2 + axis] = min(int(last), n_cells - 1)
    return boxes, n_cells


@kernel
def _overlap(one, other, depth):  # type: ignore[no-untyped-def]
    return not (_parts(one, other, depth) or _parts(other, one, depth))


@kernel
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
