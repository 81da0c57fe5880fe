"""How the triangles of a mesh hang together: edges, components, holes.

Half-edges are numbered like the corners that they start at.

Only indices count here: two vertices at one place are two. Where that is not what you want, as with
formats that split vertices at seams, weld first: ``weld_rows(mesh.positions)[mesh.faces]``.

Based on: H. Edelsbrunner, J. Harer, "Computational Topology", American Mathematical Society, 2010
(Euler characteristic and genus of closed surfaces).
"""

from __future__ import annotations

from functools import partial
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.weld import later_copies, unique_rows, weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass

# Faces or vertices per band.
_BAND = 1 << 16
# A closed surface with less volume than this, relative to its diagonal cubed, is a two-sided sheet.
_FLAT = 1e-9
# Vertices per corner from which on most of them are in no face, and are left out first.
_MOST_GAPS = 8


@dataclass(frozen=True)
class MeshEdges:
    """The edges of a mesh, each once, with the number of its faces that have three vertices."""

    vertices: IntArray  # (E, 2) int32; the lower index first, in lexicographic order
    n_faces: IntArray  # (E,) int32; faces that have the edge
    n_forward: IntArray  # (E,) int32; those of them that walk it from its lower index to its higher

    @property
    def boundary(self) -> BoolArray:
        """(E,) bool: edges of a single face."""
        return np.asarray(self.n_faces == 1)

    @property
    def non_manifold(self) -> BoolArray:
        """(E,) bool: edges of more than two faces."""
        return np.asarray(self.n_faces > 2)

    @property
    def misoriented(self) -> BoolArray:
        """(E,) bool: edges of two faces that face opposite sides: both walk it one way."""
        return np.asarray((self.n_faces == 2) & (self.n_forward != 1))

    @property
    def closed(self) -> bool:
        """Whether every edge has exactly two faces, and there is one; also called watertight."""
        return len(self.n_faces) > 0 and bool((self.n_faces == 2).all())


def find_edges(faces: IntArray) -> MeshEdges:
    """Edges of (F, 3) int32 triangles. Kernel: `core/closed_surfaces.c`."""
    n_vertices, used = int(faces.max(initial=-1)) + 1, None
    if n_vertices > _MOST_GAPS * faces.size:
        used, numbers = np.unique(faces, return_inverse=True)
        n_vertices, faces = len(used), numbers.astype(np.int32).reshape(-1, 3)
    vertices = np.empty((faces.size, 2), dtype=np.int32)
    n_faces, n_forward = np.empty((2, faces.size), dtype=np.int32)
    n = core.list_edges(
        n_vertices, np.ascontiguousarray(faces, np.int32), vertices, n_faces, n_forward
    )
    vertices = vertices[:n] if used is None else used[vertices[:n]]
    return MeshEdges(vertices, n_faces[:n], n_forward[:n])


@dataclass(frozen=True)
class EdgeNeighbors:
    """Pairs of faces at the edges of exactly two faces."""

    # first, second: (n,) int64; the faces of each edge.
    first: Int64Array
    second: Int64Array
    agree: BoolArray  # whether they are wound alike: they run along the edge in opposite directions
    # (m,) int64; the faces at all edges that have one face, or more than two; maybe repeated.
    at_other_edges: Int64Array


def edge_neighbors(faces: IntArray) -> EdgeNeighbors:
    """Find pairs of faces (F, 3) at an edge without a third face; `core/closed_surfaces.c`."""
    corners = np.ascontiguousarray(faces, np.int32).ravel()
    first, second = np.empty((2, len(corners) // 2), np.int64)
    agree, others = np.empty(len(first), np.bool_), np.empty(len(corners), np.int64)
    counts = np.empty(2, np.int64)
    n_vertices = int(corners.max(initial=-1)) + 1
    core.pair_faces(n_vertices, corners, first, second, agree, others, counts)
    n_pairs, n_others = counts.tolist()
    return EdgeNeighbors(first[:n_pairs], second[:n_pairs], agree[:n_pairs], others[:n_others])


def edge_keys(tails: AnyArray, heads: AnyArray) -> Int64Array:
    """(...) int64 numbers of half-edges, equal for those of one edge, in the order of its ends."""
    return np.asarray(np.minimum(tails, heads).astype(np.int64) << 32 | np.maximum(tails, heads))


def runs_of_keys(keys: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Sort keys; return the order, where each run of equal keys starts in it, and its length."""
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    return order, starts, np.diff(np.append(starts, len(keys)))


@dataclass(frozen=True, eq=False)
class EdgeGraph:
    """Directed edges, sorted by the vertices that they start at; see `core/shortest_paths.c`."""

    rows: Int64Array  # (V + 1,) int64; the edges from vertex i are rows[i] to rows[i + 1] - 1
    ends: IntArray  # (E,) int32; vertices
    costs: FloatArray  # (E,) float64; infinite for edges that no path takes
    order: Int64Array  # (E,) int64; the number of each edge as it was given to `build`

    @classmethod
    def build(cls, n_vertices: int, starts: IntArray, ends: IntArray, costs: FloatArray) -> Self:
        """Sort edges, each in one direction, by their starts."""
        order = np.argsort(starts, kind="stable")
        rows = np.searchsorted(starts[order], np.arange(n_vertices + 1))
        return cls(rows, ends[order], costs[order], order)

    def shorten(
        self, sources: IntArray, distances: FloatArray, before: IntArray, target: int = -1
    ) -> None:
        """Lower distances to those from further sources, and set the vertex before each."""
        core.find_shortest_paths(
            self.rows, self.ends, self.costs, sources, target, distances, before
        )

    def paths_from(self, source: int, target: int = -1) -> tuple[FloatArray, IntArray]:
        """(V,) distances and the vertices before, -1 for none; final up to the target, if any."""
        distances = np.full(len(self.rows) - 1, np.inf)
        before = np.full(len(distances), -1, dtype=np.int32)
        self.shorten(np.array([source], dtype=np.int32), distances, before, target)
        return distances, before


def path_back(before: IntArray, vertex: int) -> list[int]:
    """Vertices of the path from one back to its source, by the vertex before each."""
    path = [vertex]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path


def wind_alike(
    n_faces: int, pairs: tuple[Int64Array, Int64Array], agree: BoolArray
) -> tuple[Int64Array, BoolArray]:
    """Parts by first faces, and faces wound against those, by `core/closed_surfaces.c`."""
    parts, flips = np.arange(n_faces), np.zeros(n_faces, dtype=np.bool_)
    core.join_orientations(parts, flips, *pairs, ~agree)
    return parts, flips


def against_most(parts: Int64Array, flips: BoolArray, areas: FloatArray) -> BoolArray:
    """(F,) bool: faces wound against most of their part's area; of halves the first is right."""
    flipped = np.bincount(parts, areas * flips, len(parts))
    upright = np.bincount(parts, areas * ~flips, len(parts))
    return np.asarray(flips ^ (flipped > upright)[parts])


def repeated_vertices(faces: IntArray) -> BoolArray:
    """(F,) bool: faces that have one vertex at two corners or three."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def duplicate_faces(faces: IntArray) -> BoolArray:
    """(F,) bool: faces that repeat an earlier one: the same three vertices, in any order."""
    return later_copies(np.sort(faces, axis=1))


def two_sided_faces(faces: IntArray) -> BoolArray:
    """(F,) bool: faces that occur in both windings: the same vertices, from either side."""
    firsts = weld_rows(np.sort(faces, axis=1))
    a, b, c = faces.T
    rising = (a < b).astype(np.intp) + (b < c) + (c < a) == 2
    both = np.bincount(firsts, rising, len(faces)) * np.bincount(firsts, ~rising, len(faces)) > 0.0
    return np.asarray(both[firsts])


def face_components(faces: IntArray, n_vertices: int) -> tuple[IntArray, int]:
    """Number of the shell of each face, by first faces, and how many; none share a vertex."""
    components = np.empty(len(faces), dtype=np.int32)
    n_components = core.number_components(
        int(n_vertices), np.ascontiguousarray(faces, np.int32), components
    )
    return components, n_components


def surface_side(mesh: Mesh, *, threads: int | None = None) -> str:
    """Side seen from outside: `front`, `back`, or `both` if open or wound unlike its neighbors."""
    keys = np.empty(mesh.n_vertices, np.uint64)
    hash_positions = partial(core.hash_positions, mesh.positions, keys)
    run_bands(hash_positions, mesh.n_vertices, band=_BAND, threads=threads)
    n_bands = -(-mesh.n_faces // _BAND)
    edges, volumes = np.zeros(n_bands, np.uint64), np.zeros(n_bands)
    origin = mesh.positions[mesh.faces[0, 0]] if mesh.n_faces else np.zeros(3)

    def sum_sides(start: int, stop: int) -> None:
        band = start // _BAND
        core.sum_sides(mesh.positions, keys, mesh.faces, origin, band, edges, volumes, start, stop)

    run_bands(sum_sides, mesh.n_faces, band=_BAND, threads=threads)
    if edges.sum(dtype=np.uint64) != 0:
        return "both"
    size = mesh.diagonal
    return "back" if volumes.sum() < -_FLAT * size * size * size else "front"


def euler_characteristic(faces: IntArray, edges: MeshEdges) -> int:
    """Vertices - edges + faces, of the vertices that faces with three different ones use."""
    n_kept = len(faces) - int(np.count_nonzero(repeated_vertices(faces)))
    used = np.zeros(int(edges.vertices.max(initial=-1)) + 1, dtype=np.bool_)
    used[edges.vertices.ravel()] = True
    return int(np.count_nonzero(used)) - len(edges.vertices) + n_kept


def genus(faces: IntArray, edges: MeshEdges, n_vertices: int) -> int | None:
    """Handles of a closed surface, oriented, one fan at each vertex; None for other surfaces."""
    if not edges.closed or edges.misoriented.any():
        return None
    kept = np.ascontiguousarray(faces[~repeated_vertices(faces)], np.int32)
    if core.has_pinched_vertex(int(n_vertices), kept):
        return None
    _, n_components = face_components(kept, n_vertices)
    return n_components - euler_characteristic(faces, edges) // 2


def edge_ids(corners: npt.NDArray[np.integer[Any]]) -> Int64Array:
    """(F, 3) int64 numbers of the undirected edges from each corner to the next, from 0."""
    tails, heads = corners.astype(np.int32), np.roll(corners, -1, axis=1).astype(np.int32)
    ends = np.stack([np.minimum(tails, heads), np.maximum(tails, heads)], axis=2)
    return unique_rows(ends.reshape(-1, 2))[1].astype(np.int64).reshape(-1, 3)


def next_half_edges(half_edges: npt.NDArray[np.integer]) -> npt.NDArray[np.integer]:
    """The next half-edge of the same face; its number is also that of the corner it starts at."""
    return half_edges + np.where(half_edges % 3 == 2, -2, 1)


def opposite_half_edges(
    corners: IntArray,
    *,
    solid: BoolArray | None = None,
    regions: IntArray | None = None,
    polygons: IntArray | None = None,
) -> IntArray:
    """The half-edge opposite to each, across which the surface continues.

    `corners` (F, 3) int32: equal at one place; `solid` (F,) bool: faces to consider; `regions`
    (F,): faces of different ones are no neighbors; `polygons` (F,): triangles of one always are.
    Returns (3 F,): -1 at the boundary, and where over two faces or opposite windings meet.

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
    keys = edge_keys(starts[half_edges], ends[half_edges])
    order, begins, counts = runs_of_keys(keys)
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


def _pairs_within(labels: IntArray, keys: Int64Array) -> tuple[IndexArray, IndexArray]:
    """Indices of pairs of equal keys with one label, where no third key is the same."""
    order = np.lexsort((keys, labels))
    differs = (np.diff(keys[order]) != 0) | (np.diff(labels[order]) != 0)
    begins = np.flatnonzero(np.concatenate([[True], differs]))
    first = begins[np.diff(np.append(begins, len(keys))) == 2]
    return order[first], order[first + 1]
