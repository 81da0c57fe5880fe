"""Half-edges of triangles, numbered like the corners that they start at, and undirected edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import IntArray
from texbake.mesh.weld import unique_rows


def edge_ids(corners: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.int64]:
    """Number the undirected edges between corners.

    `corners` (F, 3) int. Returns (F, 3) int64: number of the edge from each corner to the next;
    from 0 without gaps.
    """
    tails, heads = corners.astype(np.int32), np.roll(corners, -1, axis=1).astype(np.int32)
    ends = np.stack([np.minimum(tails, heads), np.maximum(tails, heads)], axis=2)
    return unique_rows(ends.reshape(-1, 2))[1].astype(np.int64).reshape(-1, 3)


def next_half_edges(half_edges: npt.NDArray[np.integer]) -> npt.NDArray[np.integer]:
    """The next half-edge of the same face; its number is also that of the corner it starts at."""
    return half_edges + np.where(half_edges % 3 == 2, -2, 1)


def opposite_half_edges(
    corners: IntArray,
    *,
    solid: npt.NDArray[np.bool_] | None = None,
    regions: IntArray | None = None,
    polygons: IntArray | None = None,
) -> IntArray:
    """The half-edge opposite to each, across which the surface continues.

    `corners` (F, 3) int32: equal at one place; `solid` (F,) bool: faces to consider, by default
    all; `regions` (F,) int32: faces of different ones are no neighbors; `polygons` (F,) int32:
    triangles of one are neighbors even where other faces meet there. Returns (3 F,) int32: -1 at
    the boundary, and where more than two faces meet, or two of opposite winding.

    Examples
    --------
    >>> square = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    >>> opposite_half_edges(square).tolist()
    [-1, -1, 3, 2, -1, -1]
    """
    opposite = np.full(3 * len(corners), -1, dtype=np.int32)
    if solid is None:
        solid = np.ones(len(corners), dtype=np.bool_)
    if not solid.any():
        return opposite
    half_edges = (3 * np.flatnonzero(solid)[:, None] + np.arange(3)).ravel()
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    tails, heads = starts[half_edges].astype(np.int64), ends[half_edges].astype(np.int64)
    keys = (np.minimum(tails, heads) << 32) | np.maximum(tails, heads)
    order = np.argsort(keys, kind="stable")
    begins = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(np.append(begins, len(keys)))
    pairs = [order[begins[counts == 2] + side] for side in (0, 1)]
    crowded = order[np.repeat(counts > 2, counts)]
    for labels in (regions, polygons):
        if labels is not None and len(crowded):
            more = _pairs_within(labels[half_edges[crowded] // 3], keys[crowded])
            pairs = [
                np.append(side, crowded[found]) for side, found in zip(pairs, more, strict=True)
            ]
    one, other = half_edges[pairs[0]], half_edges[pairs[1]]
    glued = (starts[one] == ends[other]) & (ends[one] == starts[other]) & (one // 3 != other // 3)
    glued &= starts[one] != ends[one]
    if regions is not None:
        glued &= regions[one // 3] == regions[other // 3]
    opposite[one[glued]], opposite[other[glued]] = other[glued], one[glued]
    return opposite


def _pairs_within(
    labels: IntArray, keys: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Indices of pairs of equal keys with one label, where no third key is the same."""
    order = np.lexsort((keys, labels))
    differs = (np.diff(keys[order]) != 0) | (np.diff(labels[order]) != 0)
    begins = np.flatnonzero(np.concatenate([[True], differs]))
    first = begins[np.diff(np.append(begins, len(keys))) == 2]
    return order[first], order[first + 1]
