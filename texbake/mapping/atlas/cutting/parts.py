"""A mesh divided into connected parts of a bounded number of faces, cut where that hurts least.

The time that charts take grows faster than the mesh, so large meshes are charted in parts. Parts
grow from seeds as the cells of a Voronoi diagram do, over a graph of the faces in which a step over
a crease is long, so that their borders come to lie on creases; then each seed moves to the middle
of its part, which makes parts compact and of like size.

Distances are whole numbers: ties stay ties whatever rounding left of the positions, so that parts
do not depend on the size and place of a model.

Based on:

- David Cohen-Steiner, Pierre Alliez, Mathieu Desbrun, "Variational shape approximation", 2004
  (Lloyd's iteration over the faces of a mesh, flooded from seeds).
- Robert Dial, "Algorithm 360: Shortest-path forest with topological ordering", 1969 (the queue).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray

# Units that make a step between neighbors of mean distance, and the longest step. The first is no
# round number, so that the steps of regular meshes do not lie halfway between two whole numbers.
_UNITS_A_STEP = 4.236
_LONGEST_STEP = 63

# A step over a right angle is longer than one on a plane by this many times.
_CREASE = 30.0

# Normals are averaged over the neighbors this often first, so that noise makes no creases.
_SMOOTHINGS = 1

_ITERATIONS = 3

# Parts stop growing at this many times the size that they should have ...
_MOST = 1.5
# ... and what stays smaller than this share is given to a neighbor.
_LEAST = 0.25

_FAR = np.iinfo(np.int32).max
_OPEN, _CLOSED = np.int32(-1), np.int32(-2)  # labels of faces that wait for one, and that do not


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Some faces of a mesh, and how they hang together by themselves.

    Attributes
    ----------
    face_ids : (m,) int32
        Of the mesh, ascending.
    opposite : (3 m,) int32
        Half-edge on the other side of each, among those of the part; -1 where there is none.
    """

    face_ids: IntArray
    opposite: IntArray


def divided_parts(
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
        On the grid, in the unit cube.
    faces : (F, 3) int32
        Indices into `points`.
    opposite : (3 F,) int32
        Half-edge on the other side of each, -1 where there is none.
    parts : (F,) int32
        Each connected, numbered from 0 without gaps.
    part_faces : int
        Faces that the new parts should have.
    whole_faces : int
        A part of at most so many faces stays whole.

    Returns
    -------
    (F,) int32
        Each connected, numbered from 0 without gaps; new parts come after those that stayed whole.
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
    _trim_kernel(neighbors, labels)
    _, numbers = np.unique(np.where(large, labels + len(faces), parts), return_inverse=True)
    return numbers.astype(np.int32)


def split_parts(opposite: IntArray, labels: IntArray) -> list[Part]:
    """Make a part of the faces of each label, of those from 0; those of others are left out.

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
    """(F, 3) int32: length of the step to each neighbor, from 1 to `_LONGEST_STEP`."""
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
    """(n,) int32: the face farthest from its border, of every label that `least` faces have."""
    ends = (labels[neighbors] != labels[:, None]) | (neighbors < 0)
    border = np.flatnonzero(ends.any(axis=1) & (labels >= 0)).astype(np.int32)
    reached = np.where(labels >= 0, _OPEN, _CLOSED)
    distances = _flood(neighbors, steps, reached, border, labels[border], labels, len(labels))
    faces = np.flatnonzero(labels >= 0)
    # The first of the farthest; a face that nothing bounds is as far as any.
    keys = distances[faces].astype(np.int64) << 32 | (_FAR - faces)
    farthest = np.full(int(labels.max()) + 1, -1, dtype=np.int64)
    np.maximum.at(farthest, labels[faces], keys)
    farthest = farthest[np.bincount(labels[faces]) >= max(least, 1)]
    return (_FAR - (farthest & _FAR)).astype(np.int32)


def _without_pockets(neighbors: IntArray, labels: IntArray, least: int) -> IntArray:
    """Give every label of less than `least` faces to the one that it shares most sides with."""
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
    """Give open faces the label of the source that is nearest to them, by steps between neighbors.

    No step crosses from one value of `within` to another, and no label gets more than `most` faces.
    `labels` is filled in; returns (F,) int32 distances.
    """
    distances = np.full(len(labels), _FAR, dtype=np.int32)
    sizes = np.zeros(int(source_labels.max(initial=-1)) + 1, dtype=np.int32)
    queue = np.empty((3 * len(labels) + len(sources), 3), dtype=np.int32)
    _flood_kernel(
        neighbors, steps, labels, sources, source_labels, within, most, distances, sizes, queue
    )
    return distances


def _seed(neighbors: IntArray, steps: IntArray, labels: IntArray, part_faces: int) -> None:
    """Give the open faces new labels, in patches of at most `part_faces` grown one by one."""
    queue = np.empty((3 * len(labels) + 1, 3), dtype=np.int32)
    _seed_kernel(neighbors, steps, labels, part_faces, np.full(len(labels), _FAR, np.int32), queue)


@kernel
def _flood_kernel(  # type: ignore[no-untyped-def]
    neighbors, steps, labels, sources, source_labels, within, most, distances, sizes, queue
):
    """Dial's algorithm.

    Faces wait in as many lists as there are lengths of steps, of which one is always due. Rows of
    `queue` are a face, the label offered to it, and the next row of its list.
    """
    heads = np.full(_LONGEST_STEP + 1, -1, dtype=np.int32)
    for row in range(len(sources)):
        queue[row, 0], queue[row, 1], queue[row, 2] = sources[row], source_labels[row], heads[0]
        heads[0] = row
    n_rows, n_waiting, distance = len(sources), len(sources), 0
    while n_waiting > 0:
        slot = distance % len(heads)
        while heads[slot] >= 0:
            face, label = queue[heads[slot], 0], queue[heads[slot], 1]
            heads[slot] = queue[heads[slot], 2]
            n_waiting -= 1
            if labels[face] != _OPEN:
                continue
            if sizes[label] >= most:
                distances[face] = _FAR  # another label may have it
                continue
            labels[face], distances[face] = label, distance
            sizes[label] += 1
            for side in range(3):
                other = neighbors[face, side]
                if other < 0 or labels[other] != _OPEN or within[other] != within[face]:
                    continue
                reach = distance + steps[face, side]
                if reach < distances[other]:
                    distances[other] = reach
                    due = reach % len(heads)
                    queue[n_rows, 0], queue[n_rows, 1], queue[n_rows, 2] = other, label, heads[due]
                    heads[due] = n_rows
                    n_rows += 1
                    n_waiting += 1
        distance += 1


@kernel
def _seed_kernel(neighbors, steps, labels, part_faces, distances, queue):  # type: ignore[no-untyped-def]
    n_labels = labels.max() + 1
    sizes = np.zeros(n_labels + len(labels), dtype=np.int32)
    source, source_label = np.empty(1, dtype=np.int32), np.empty(1, dtype=np.int32)
    everywhere = np.zeros(len(labels), dtype=np.int32)
    for face in range(len(labels)):
        if labels[face] == _OPEN:
            source[0], source_label[0] = face, n_labels
            _flood_kernel(
                neighbors,
                steps,
                labels,
                source,
                source_label,
                everywhere,
                part_faces,
                distances,
                sizes,
                queue,
            )
            n_labels += 1


@kernel
def _trim_kernel(neighbors, labels):  # type: ignore[no-untyped-def]
    """Give every face that hangs on its part by one side to the part at its two others.

    Without such teeth, borders do not get to lie on themselves in the plane so easily.
    """
    for _ in range(2):
        for face in range(len(labels)):
            one, two, three = neighbors[face]
            if one < 0 or two < 0 or three < 0:
                continue
            if labels[one] == labels[two] or labels[one] == labels[three]:
                labels[face] = labels[one]
            elif labels[two] == labels[three]:
                labels[face] = labels[two]
