"""Which faces may lie side by side in a chart, and what hangs together.

A half-edge is the edge of one face from one of its corners to the next, number 3 f + c for corner
c of face f. Two half-edges may be glued where two faces, and no more, meet along one edge and walk
it in opposite directions.

Based on: K. Weiler, "Edge-based data structures for solid modeling in curved-surface environments",
1985 (half-edges); R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mapping.seams import edge_ids
from texbake.mesh.mesh import IntArray


def opposite_half_edges(
    corners: IntArray, *, solid: npt.NDArray[np.bool_], regions: IntArray | None = None
) -> IntArray:
    """Half-edge on the other side of each, where the surface goes on.

    Parameters
    ----------
    corners : (F, 3) int32
        Equal for corners at one place.
    solid : (F,) bool
        Faces to look at, as if there were no others.
    regions : (F,) int32, optional
        Faces of different regions have nothing to do with each other.

    Returns
    -------
    (3 F,) int32
        -1 where there is none: at the boundary, between regions, where more than two faces meet,
        and where two faces of opposite winding do.

    Examples
    --------
    >>> square = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    >>> opposite_half_edges(square, solid=np.array([True, True])).tolist()
    [-1, -1, 3, 2, -1, -1]
    """
    opposite = np.full(3 * len(corners), -1, dtype=np.int32)
    if not solid.any():
        return opposite
    half_edges = (3 * np.flatnonzero(solid)[:, None] + np.arange(3)).ravel()
    edges = edge_ids(corners[solid]).ravel()
    order = np.argsort(edges, kind="stable")
    counts = np.bincount(edges)
    first = (np.cumsum(counts) - counts)[counts == 2]
    one, other = half_edges[order[first]], half_edges[order[first + 1]]
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    glued = (starts[one] == ends[other]) & (ends[one] == starts[other]) & (one // 3 != other // 3)
    glued &= starts[one] != ends[one]
    if regions is not None:
        glued &= regions[one // 3] == regions[other // 3]
    opposite[one[glued]], opposite[other[glued]] = other[glued], one[glued]
    return opposite


def next_half_edges(half_edges: npt.NDArray[np.integer]) -> npt.NDArray[np.integer]:
    """Half-edge of the same face that starts where each ends; by that also the corner there."""
    return half_edges + np.where(half_edges % 3 == 2, -2, 1)


def merged_labels(n_items: int, firsts: IntArray, seconds: IntArray) -> IntArray:
    """Number what is connected by pairs.

    Parameters
    ----------
    n_items : int
    firsts, seconds : (N,) int
        Items of each pair.

    Returns
    -------
    (n_items,) int32
        Equal for items that a chain of pairs connects; from 0 without gaps, in the order of the
        first item of each.

    Examples
    --------
    >>> merged_labels(4, np.array([3]), np.array([1])).tolist()
    [0, 1, 2, 1]
    """
    labels = np.arange(n_items, dtype=np.int32)
    _merge_kernel(
        labels,
        np.ascontiguousarray(firsts, dtype=np.int32),
        np.ascontiguousarray(seconds, dtype=np.int32),
    )
    return labels


@kernel
def _merge_kernel(labels, firsts, seconds):  # type: ignore[no-untyped-def]
    """Union-find with path halving; a tree's root is its least item, so numbering is one pass."""
    for i in range(len(firsts)):
        one, other = firsts[i], seconds[i]
        while labels[one] != one:
            labels[one] = labels[labels[one]]
            one = labels[one]
        while labels[other] != other:
            labels[other] = labels[labels[other]]
            other = labels[other]
        if one < other:
            labels[other] = one
        else:
            labels[one] = other
    n_labels = 0
    for item in range(len(labels)):
        if labels[item] == item:
            labels[item] = n_labels
            n_labels += 1
        else:
            labels[item] = labels[labels[item]]
