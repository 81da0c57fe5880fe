"""Holes of a surface: the loops of its boundary, and triangles that fill them.

A loop of edges that have an odd number of faces passes no vertex twice, so that a boundary that
touches itself is several loops. Their triangles are those of a polygon with the loop's corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.polygons import cut_polygons, next_corners
from texbake.mesh.topology import edge_neighbors, face_components, find_edges

BoolArray = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Loops:
    """The loops of a boundary."""

    vertices: IntArray  # (n,) int32; those of each loop in turn
    sizes: Indices  # (m,) int64
    # (m,) float64; twice the distance of the farthest vertex from the mean of all.
    widths: FloatArray
    lengths: FloatArray  # (m,) float64; along the edges
    # (m,) int32; the separate part of the surface that each bounds, as in `face_components`.
    parts: IntArray

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray) -> Loops:
        """Find the loops.

        `points` (V, 3) float64; `faces` (F, 3) int32.
        """
        edges = find_edges(faces)
        odd = edges.vertices[edges.n_faces % 2 == 1]
        loops = _traced(odd.tolist())
        if not loops:
            return NO_LOOPS
        sizes = np.array([len(loop) for loop in loops], dtype=np.int64)
        vertices = np.array([vertex for loop in loops for vertex in loop], dtype=np.int32)
        part_of = np.zeros(len(points), dtype=np.int32)
        part_of[faces] = face_components(faces, len(points))[0][:, None]
        starts = np.cumsum(sizes) - sizes
        corners = points[vertices]
        means = np.add.reduceat(corners, starts, axis=0) / sizes[:, None]
        offsets = corners - np.repeat(means, sizes, axis=0)
        reach = np.maximum.reduceat((offsets * offsets).sum(axis=1), starts)
        steps = corners[next_corners(sizes)] - corners
        lengths = np.add.reduceat(np.sqrt((steps * steps).sum(axis=1)), starts)
        return cls(vertices, sizes, 2.0 * np.sqrt(reach), lengths, part_of[vertices[starts]])

    @property
    def outer(self) -> BoolArray:
        """(m,) bool: the longest loop of each part."""
        order = np.lexsort((-self.lengths, self.parts))
        outer = np.zeros(len(order), dtype=np.bool_)
        outer[order[np.flatnonzero(np.diff(self.parts[order], prepend=-1))]] = True
        return outer

    @property
    def edges(self) -> IntArray:
        """(n, 2) int32: the edge from each vertex to the next of its loop."""
        return np.stack([self.vertices, self.vertices[next_corners(self.sizes)]], axis=1)

    def filled(self, points: FloatArray, chosen: BoolArray) -> tuple[IntArray, Indices]:
        """Triangulate some loops.

        `points` (V, 3) float64; `chosen` (m,) bool. Returns `faces` (n, 3) int32; `loops` (n,)
        int64: which loop each of them fills.
        """
        vertices = np.ascontiguousarray(self.vertices[np.repeat(chosen, self.sizes)])
        triangles, owners, _ = cut_polygons(points, vertices, self.sizes[chosen])
        return vertices[triangles], np.flatnonzero(chosen)[owners]

    def fanned(self, points: FloatArray, chosen: BoolArray) -> tuple[FloatArray, IntArray]:
        """Fill some small loops with a fan each, around the mean of their vertices.

        Returns `points` (V + n, 3) float64; `faces` (m, 3) int32.
        """
        sizes, edges = self.sizes[chosen], self.edges[np.repeat(chosen, self.sizes)]
        if len(sizes) == 0:
            return points, edges.reshape(0, 3)
        means = np.add.reduceat(points[edges[:, 0]], np.cumsum(sizes) - sizes, axis=0)
        centers = len(points) + np.repeat(np.arange(len(sizes)), sizes)
        faces = np.column_stack([edges, centers]).astype(np.int32)
        return np.concatenate([points, means / sizes[:, None]]), faces


NO_LOOPS = Loops(
    np.zeros(0, np.int32), np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int32)
)


def _traced(edges: list[list[int]]) -> list[list[int]]:
    """The loops of undirected edges, of which an even number meet at each vertex."""
    neighbors: dict[int, list[int]] = {}
    for a, b in edges:
        neighbors.setdefault(a, []).append(b)
        neighbors.setdefault(b, []).append(a)
    loops = []
    for start, others in neighbors.items():
        path, places = [start], {start: 0}
        while others or len(path) > 1:
            vertex = path[-1]
            after = neighbors[vertex].pop()
            neighbors[after].remove(vertex)
            if after not in places:
                places[after] = len(path)
                path.append(after)
                continue
            loops.append(path[places[after] :])
            for passed in path[places[after] + 1 :]:
                del places[passed]
            del path[places[after] + 1 :]
    return loops


def with_own_fans(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Give each fan of faces around a vertex a vertex of its own, and leave out unused ones.

    Faces are neighbors across an edge that has two.
    """
    pairs = edge_neighbors(faces)
    corners = faces.ravel()
    tails, heads = [], []
    for k in range(3):
        for j in range(3):
            one, other = 3 * pairs.first + k, 3 * pairs.second + j
            same = corners[one] == corners[other]
            tails.append(one[same])
            heads.append(other[same])
    labels = np.arange(len(corners), dtype=np.int32)
    core.merge_labels(
        labels, np.concatenate(tails).astype(np.int32), np.concatenate(heads).astype(np.int32)
    )
    firsts = np.unique(labels, return_index=True)[1]
    return points[corners[firsts]], labels.reshape(-1, 3)
