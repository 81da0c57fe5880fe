"""A mesh divided into connected parts of a bounded number of faces, with borders along creases.

The time that charts take grows faster than the mesh, so that large meshes are charted in parts.
Parts grow from seeds like the cells of a Voronoi diagram, over a graph of the faces in which a step
across a crease is long, so that borders settle on creases. Each seed then moves to the middle of
its part, which makes parts compact and of similar size.

Distances are whole numbers: ties stay ties in spite of rounding in the positions, so that parts do
not depend on the size and position of a model.

Based on: David Cohen-Steiner, Pierre Alliez, Mathieu Desbrun, "Variational shape approximation",
2004 (Lloyd's iteration over the faces of a mesh, flooded from seeds).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.core import core
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray

# Labels of faces that await a label, or take none, and the distance of faces that nothing reaches;
# `core/dial_flood.c` has the same, and room for steps of at most this length.
_OPEN, _CLOSED = np.int32(-1), np.int32(-2)
_FAR = np.iinfo(np.int32).max
_LONGEST_STEP = 63

# Length of a step between neighbors at the mean distance. It is not a round number, so that the
# steps of regular meshes do not lie halfway between two whole numbers.
_UNITS_A_STEP = 4.236

# How many times longer a step across a right angle is than one on a plane.
_CREASE = 30.0

# Rounds of averaging normals over neighbors beforehand, so that noise makes no creases.
_SMOOTHINGS = 1

_ITERATIONS = 3

# Parts stop growing at this multiple of their intended size ...
_MOST = 1.5

# ... and parts below this share of it go to a neighbor.
_LEAST = 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Some faces of a mesh, and which of them are neighbors.

    Attributes
    ----------
    face_ids : (m,) int32
        Faces of the mesh, ascending.
    opposite : (3 m,) int32
        Opposite of each half-edge, numbered within the part; -1 where there is none.
    """

    face_ids: IntArray
    opposite: IntArray


def divide_parts(
    points: FloatArray,
    faces: IntArray,
    opposite: IntArray,
    parts: IntArray,
    *,
    part_faces: int,
    whole_faces: int,
) -> IntArray:
    """Divide the parts of a mesh that have too many faces.

    Parameters
    ----------
    points : (V, 3) float64
        Points on the grid, in the unit cube.
    faces : (F, 3) int32
        Indices into `points`.
    opposite : (3 F,) int32
        Opposite of each half-edge, -1 where there is none.
    parts : (F,) int32
        Part of each face: connected, and numbered from 0 without gaps.
    part_faces : int
        Number of faces that new parts should have.
    whole_faces : int
        A part of at most this many faces stays whole.

    Returns
    -------
    (F,) int32
        Part of each face: connected, and numbered from 0 without gaps; new parts come last.
    """
    large = (np.bincount(parts) > whole_faces)[parts]
    if not large.any():
        return parts
    least, most = int(_LEAST * part_faces), int(_MOST * part_faces)
    neighbors = np.where(opposite >= 0, opposite // 3, -1).astype(np.int32).reshape(-1, 3)
    steps = _steps(points, faces, neighbors)
    labels = np.where(large, _OPEN, _CLOSED)
    _seed(neighbors, steps, labels, part_faces)
    for _ in range(_ITERATIONS):
        seeds = _centers(neighbors, steps, labels, least)
        labels = np.where(large, _OPEN, _CLOSED)
        _flood(neighbors, steps, labels, seeds, np.arange(len(seeds), dtype=np.int32), parts, most)
        _seed(neighbors, steps, labels, part_faces)
    labels = _without_pockets(neighbors, labels, least)
    core.trim_teeth(neighbors, labels)
    _, numbers = np.unique(np.where(large, labels + len(faces), parts), return_inverse=True)
    return numbers.astype(np.int32)


def split_parts(opposite: IntArray, labels: IntArray) -> list[Part]:
    """Make a part of the faces of each label from 0 on; faces with negative labels are left out.

    Parameters
    ----------
    opposite : (3 F,) int32
    labels : (F,) int32
    """
    order = np.argsort(labels, kind="stable").astype(np.int32)
    order = order[np.count_nonzero(labels < 0) :]
    sizes = np.bincount(labels[order])
    ends = np.cumsum(sizes)
    within = np.full(len(labels), -1, dtype=np.int32)
    within[order] = np.arange(len(order)) - np.repeat(ends - sizes, sizes)
    other = opposite // 3
    inner = (opposite >= 0) & (labels[other] == np.repeat(labels, 3))
    local = np.where(inner, 3 * within[other] + opposite % 3, -1).astype(np.int32).reshape(-1, 3)
    return [
        Part(face_ids=face_ids, opposite=local[face_ids].ravel())
        for face_ids in np.split(order, ends[:-1])
        if len(face_ids)
    ]


def _steps(points: FloatArray, faces: IntArray, neighbors: IntArray) -> IntArray:
    """(F, 3) int32: distance to each neighbor, from 1 to `_LONGEST_STEP`."""
    corners = points[faces]
    centroids = corners.mean(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    beyond = neighbors >= 0
    for _ in range(_SMOOTHINGS):
        normals += np.where(beyond[:, :, None], normals[neighbors], 0.0).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.maximum(lengths, np.finfo(np.float64).tiny)
    steps = np.empty(neighbors.shape)
    for side in range(3):
        others = neighbors[:, side]
        cosines = np.einsum("ij,ij->i", normals, normals[others])
        steps[:, side] = np.linalg.norm(centroids - centroids[others], axis=1)
        steps[:, side] *= 1.0 + _CREASE * (1.0 - cosines)
    mean = steps[beyond].mean() if beyond.any() else 0.0
    units = steps * (_UNITS_A_STEP / mean if mean > 0.0 else 0.0)
    return np.clip(np.rint(units), 1, _LONGEST_STEP).astype(np.int32)


def _centers(neighbors: IntArray, steps: IntArray, labels: IntArray, least: int) -> IntArray:
    """(n,) int32: the face farthest from the border, of every label with at least `least` faces."""
    ends = (labels[neighbors] != labels[:, None]) | (neighbors < 0)
    border = np.flatnonzero(ends.any(axis=1) & (labels >= 0)).astype(np.int32)
    reached = np.where(labels >= 0, _OPEN, _CLOSED)
    distances = _flood(neighbors, steps, reached, border, labels[border], labels, len(labels))
    faces = np.flatnonzero(labels >= 0)
    # The first of the farthest faces; one without any border is as far as possible.
    keys = distances[faces].astype(np.int64) << 32 | (_FAR - faces)
    farthest = np.full(int(labels.max()) + 1, -1, dtype=np.int64)
    np.maximum.at(farthest, labels[faces], keys)
    farthest = farthest[np.bincount(labels[faces]) >= max(least, 1)]
    return (_FAR - (farthest & _FAR)).astype(np.int32)


def _without_pockets(neighbors: IntArray, labels: IntArray, least: int) -> IntArray:
    """Merge every label of fewer than `least` faces into the one that it shares most sides with."""
    sizes = np.bincount(labels[labels >= 0])
    faces, sides = np.nonzero((neighbors >= 0) & (labels >= 0)[:, None])
    small, large = labels[faces].astype(np.int64), labels[neighbors[faces, sides]]
    met = (sizes[small] < least) & (sizes[large] >= least)
    pairs, counts = np.unique(small[met] << 32 | large[met], return_counts=True)
    pairs = pairs[np.argsort(counts, kind="stable")]
    into = np.arange(len(sizes), dtype=np.int32)
    into[pairs >> 32] = pairs & _FAR  # of several, the last one counts
    return np.where(labels >= 0, into[np.maximum(labels, 0)], labels)


def _flood(
    neighbors: IntArray,
    steps: IntArray,
    labels: IntArray,
    sources: IntArray,
    source_labels: IntArray,
    within: IntArray,
    most: int,
) -> IntArray:
    """Give each open face the label of its nearest source, and return (F,) int32 distances.

    No step crosses from one value of `within` to another, and no label gets more than `most` faces.
    `labels` is written to. Kernel: `core/dial_flood.c`.
    """
    distances = np.empty(len(labels), dtype=np.int32)
    n_labels = int(source_labels.max(initial=-1)) + 1
    core.flood_faces(
        n_labels, neighbors, steps, labels, sources, source_labels, within, most, distances
    )
    return distances


def _seed(neighbors: IntArray, steps: IntArray, labels: IntArray, part_faces: int) -> None:
    """Give the open faces new labels, in patches of at most `part_faces` faces.

    Kernel: `core/dial_flood.c`.
    """
    core.seed_faces(neighbors, steps, labels, part_faces)


def connected_parts(opposite: IntArray) -> IntArray:
    """(F,) int32: connected piece of each face, numbered in the order of first faces."""
    half_edges = np.flatnonzero(opposite > np.arange(len(opposite))).astype(np.int32)
    return merged_labels(len(opposite) // 3, half_edges // 3, opposite[half_edges] // 3)


def face_batches(
    points: FloatArray,
    corners: IntArray,
    part: Part,
    *,
    part_faces: int,
    regions: IntArray,
) -> list[IntArray]:
    """Divide some faces of a mesh into batches that xatlas cuts one at a time.

    Parameters
    ----------
    points : (V, 3) float64
        Points on the grid, in the unit cube.
    corners : (F, 3) int32
        Corners of the mesh's faces: indices into `points`.
    part : Part
        The faces, which need not be connected.
    part_faces : int
        Number of faces that a batch should have; a connected piece is divided above 1.5 times that.
    regions : (F,) int32
        Faces of different regions are in different batches.

    Returns
    -------
    list of (n,) int32
        Faces of each batch, ascending.
    """
    pieces = connected_parts(part.opposite)
    labels = divide_parts(
        points,
        corners[part.face_ids],
        part.opposite,
        pieces,
        part_faces=part_faces,
        whole_faces=part_faces + part_faces // 2,
    )
    batches = _batched(labels, pieces, regions[part.face_ids], part_faces)
    return [part.face_ids[batch.face_ids] for batch in split_parts(part.opposite, batches)]


def _batched(parts: IntArray, pieces: IntArray, regions: IntArray, batch_faces: int) -> IntArray:
    """(F,) int32: batch of each face. Each part of a divided piece is one; small pieces share one.

    Pieces that share a batch have no common edges, so that nothing is joined again.
    """
    sizes = np.bincount(parts)
    first = np.unique(parts, return_index=True)[1]
    piece_of, region_of = pieces[first], regions[first]
    divided = np.bincount(piece_of)[piece_of] > 1
    # A new batch begins whenever the faces so far fill one.
    order = np.argsort(region_of, kind="stable")
    shared = np.where(divided, 0, sizes)[order]
    numbers = np.empty(len(sizes), dtype=np.int64)
    numbers[order] = (np.cumsum(shared) - shared) // batch_faces
    numbers[divided] = len(parts) + np.flatnonzero(divided)
    keys = region_of.astype(np.int64) << 32 | numbers
    batches: IntArray = np.unique(keys, return_inverse=True)[1].astype(np.int32)
    return batches[parts]
