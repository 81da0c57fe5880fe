"""Closest points on triangles, found with a bounding volume hierarchy.

Based on: Tero Karras, "Maximizing parallelism in the construction of BVHs, octrees, and k-d trees",
High-Performance Graphics 2012: triangles in Morton order are split where their highest differing
bit changes. Triangles of one code are split in the middle, so that the depth is bounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.closest_point import closest_on_triangle, dot, minus, point_at, weighted
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

_LEAF_SIZE = 4
_BAND = 1 << 13

# Levels: one for each of the 63 bits that triangles are split by at most, one for each halving of
# the 2^31 triangles at most of one code. The stack holds one node a level, and two at the last.
STACK_SIZE = 63 + 31 + 2


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles in a tree of bounding boxes, made by `TriangleTree.build`.

    Attributes
    ----------
    positions : (V, 3) float64
    faces : (F, 3) int32
    order : (F,) int32
        Face ids, so that those below a node are contiguous.
    boxes : (N, 6) float32
        Least x, y, z, then greatest of each node, rounded outward.
    nodes : (N, 2) int32
        Of a leaf the first of its faces in `order` and their number; of an inner node the first of
        its two children, which are neighbors, and 0.
    """

    positions: FloatArray
    faces: IntArray
    order: IntArray
    boxes: npt.NDArray[np.float32]
    nodes: IntArray

    @classmethod
    def build(
        cls, positions: npt.ArrayLike, faces: npt.ArrayLike, *, threads: int | None = None
    ) -> TriangleTree:
        """Build the tree.

        Parameters
        ----------
        positions : (V, 3) float64
            Finite; in a frame in which they are about as large as the mesh, such as `LocalFrame`'s,
            because boxes are float32 (elsewhere the answers stay right but come more slowly).
        faces : (F, 3) int32
            At least one.
        """
        positions = _shared(positions, np.float64)
        faces = _shared(faces, np.int32)
        ids, codes = _morton_order(positions, faces, threads)
        boxes = np.empty((2 * len(faces), 6), dtype=np.float32)
        nodes = np.empty((2 * len(faces), 2), dtype=np.int32)
        n_nodes = _build_kernel(positions, faces, ids, codes, boxes, nodes)
        return cls(positions, faces, ids, boxes[:n_nodes].copy(), nodes[:n_nodes].copy())

    def closest_points(
        self,
        points: npt.ArrayLike,
        *,
        max_distance: float = float("inf"),
        threads: int | None = None,
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Closest point of the triangles to each point.

        Points that are near each other in the list are found faster: each search starts from the
        face found before.

        Parameters
        ----------
        points : (n, 3) float64
            In the frame of the positions.
        max_distance
            Points with nothing within it get an infinite distance.
        threads
            None for every processor.

        Returns
        -------
        distances : (n,) float64
            inf where nothing lies within `max_distance`.
        face_ids : (n,) int32
            -1 there. Where several faces are equally close, one of them, the same on every run.
        barycentrics : (n, 3) float64
            Weights of the face's corners, none negative, their sum 1 to rounding; 0 there.
        """
        points = _shared(points, np.float64)
        tree = (self.positions, self.faces, self.order, self.boxes, self.nodes)
        limit = float(max_distance)
        distances = np.empty(len(points))
        face_ids = np.empty(len(points), dtype=np.int32)
        barycentrics = np.empty((len(points), 3))

        def work(start: int, stop: int) -> None:
            _closest_points_kernel(
                tree, points, limit, start, stop, distances, face_ids, barycentrics
            )

        run_bands(work, len(points), band=_BAND, threads=threads)
        return distances, face_ids, barycentrics


def _shared(values: npt.ArrayLike, dtype: type) -> npt.NDArray[Any]:
    """Contiguous, as a read-only view: numba compiles once for each kind of array."""
    array: npt.NDArray[Any] = np.ascontiguousarray(values, dtype=dtype).view()
    array.flags.writeable = False
    return array


def _morton_order(
    positions: FloatArray, faces: IntArray, threads: int | None
) -> tuple[IntArray, npt.NDArray[np.uint64]]:
    """Face ids along a Morton curve through their centers, and their codes in that order."""
    # The id fills the low bits of the sorted key, the code all others: sorting plain integers is
    # several times faster than finding the permutation that sorts them.
    id_bits = max(1, int(len(faces) - 1).bit_length())
    axis_bits = (64 - id_bits) // 3
    low = positions.min(axis=0)
    extent = float((positions.max(axis=0) - low).max())
    cells_a_unit = (2.0**axis_bits - 1.0) / extent if extent > 0.0 else 0.0
    keys = np.empty(len(faces), dtype=np.uint64)

    def work(start: int, stop: int) -> None:
        _morton_kernel(positions, faces, low, cells_a_unit, axis_bits, id_bits, start, stop, keys)

    run_bands(work, len(faces), band=1 << 17, threads=threads)
    keys.sort()
    ids = (keys & np.uint64((1 << id_bits) - 1)).astype(np.int32)
    keys >>= np.uint64(id_bits)
    return ids, keys


@kernel
def _morton_kernel(positions, faces, low, cells_a_unit, axis_bits, id_bits, start, stop, keys):  # type: ignore[no-untyped-def]
    for face in range(start, stop):
        code = np.uint64(0)
        for axis in range(3):
            first = positions[faces[face, 0], axis]
            least, most = first, first
            for corner in range(1, 3):
                value = positions[faces[face, corner], axis]
                least, most = min(least, value), max(most, value)
            cell = np.uint64((0.5 * least + 0.5 * most - low[axis]) * cells_a_unit)
            for bit in range(axis_bits):
                code |= ((cell >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
        keys[face] = (code << np.uint64(id_bits)) | np.uint64(face)


@kernel
def _build_kernel(positions, faces, ids, codes, boxes, nodes):  # type: ignore[no-untyped-def]
    """Split ranges of the order from the top, then join boxes from the bottom; number of nodes."""
    nodes[0, 0], nodes[0, 1] = 0, len(ids)
    n_nodes, node = 1, 0
    while node < n_nodes:
        first, count = nodes[node, 0], nodes[node, 1]
        if count > _LEAF_SIZE:
            last = first + count - 1
            split = first + count // 2
            differing = codes[first] ^ codes[last]
            if differing != 0:
                bit = np.uint64(1)
                while differing > np.uint64(1):
                    differing >>= np.uint64(1)
                    bit <<= np.uint64(1)
                below, split = first, last  # the first code with the bit lies in (below, split]
                while split - below > 1:
                    middle = (below + split) // 2
                    if codes[middle] & bit:
                        split = middle
                    else:
                        below = middle
            nodes[n_nodes, 0], nodes[n_nodes, 1] = first, split - first
            nodes[n_nodes + 1, 0], nodes[n_nodes + 1, 1] = split, first + count - split
            nodes[node, 0], nodes[node, 1] = n_nodes, 0
            n_nodes += 2
        node += 1
    for node in range(n_nodes - 1, -1, -1):  # children come after their parent
        first, count = nodes[node, 0], nodes[node, 1]
        for axis in range(3):
            if count == 0:
                boxes[node, axis] = min(boxes[first, axis], boxes[first + 1, axis])
                boxes[node, axis + 3] = max(boxes[first, axis + 3], boxes[first + 1, axis + 3])
                continue
            least, most = np.inf, -np.inf
            for slot in range(first, first + count):
                for corner in range(3):
                    value = positions[faces[ids[slot], corner], axis]
                    least, most = min(least, value), max(most, value)
            boxes[node, axis] = np.nextafter(np.float32(least), np.float32(-np.inf))
            boxes[node, axis + 3] = np.nextafter(np.float32(most), np.float32(np.inf))
    return n_nodes


@kernel
def _box_distance_squared(boxes, node, p):  # type: ignore[no-untyped-def]
    dx = max(boxes[node, 0] - p[0], 0.0, p[0] - boxes[node, 3])
    dy = max(boxes[node, 1] - p[1], 0.0, p[1] - boxes[node, 4])
    dz = max(boxes[node, 2] - p[2], 0.0, p[2] - boxes[node, 5])
    return dx * dx + dy * dy + dz * dz


@kernel
def _closest_points_kernel(  # type: ignore[no-untyped-def]
    tree, points, max_distance, start, stop, distances, face_ids, barycentrics
):
    positions, faces, order, boxes, nodes = tree
    stack = np.empty(STACK_SIZE, dtype=np.int32)
    bounds = np.empty(STACK_SIZE)
    limit = max_distance * max_distance
    nearby = point_at(
        positions, faces[order[0], 0]
    )  # a point of the surface, close to the last answer
    for k in range(start, stop):
        p = point_at(points, k)
        offset = minus(p, nearby)
        best, best_face, best_v, best_w = min(limit, dot(offset, offset)), -1, 0.0, 0.0
        while True:
            stack[0], bounds[0], size = 0, 0.0, 1
            while size > 0:
                size -= 1
                node = stack[size]
                if bounds[size] > best:
                    continue
                first, count = nodes[node, 0], nodes[node, 1]
                for slot in range(first, first + count):
                    face = order[slot]
                    a = point_at(positions, faces[face, 0])
                    ab = minus(point_at(positions, faces[face, 1]), a)
                    ac = minus(point_at(positions, faces[face, 2]), a)
                    v, w, squared = closest_on_triangle(ab, ac, minus(p, a))
                    if squared < best or (squared == best and best_face < 0):
                        best, best_face, best_v, best_w = squared, face, v, w
                if count == 0:
                    near = _box_distance_squared(boxes, first, p)
                    far = _box_distance_squared(boxes, first + 1, p)
                    swapped = np.int32(near > far)
                    stack[size], bounds[size] = first + 1 - swapped, max(near, far)
                    stack[size + 1], bounds[size + 1] = first + swapped, min(near, far)
                    size += 2
            if best_face >= 0 or best >= limit:
                break
            best = limit  # rounding put the point nearby out of its own reach
        face_ids[k] = best_face
        if best_face < 0:
            distances[k] = np.inf
            barycentrics[k, :] = 0.0
            continue
        distances[k] = math.sqrt(best)
        barycentrics[k, 0] = max(1.0 - best_v - best_w, 0.0)
        barycentrics[k, 1], barycentrics[k, 2] = best_v, best_w
        a = point_at(positions, faces[best_face, 0])
        ab = minus(point_at(positions, faces[best_face, 1]), a)
        ac = minus(point_at(positions, faces[best_face, 2]), a)
        on_face = weighted(ab, ac, best_v, best_w)
        nearby = (a[0] + on_face[0], a[1] + on_face[1], a[2] + on_face[2])
