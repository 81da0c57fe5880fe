r"""Triangles cut where their edges are too long, without a crack anywhere.

What is cut is edges, in the middle, and never a triangle by itself: a triangle follows from which
of its edges were cut, into two, three or four pieces. So the triangles on both sides of an edge
agree on its points whatever each of them looks like, and every cut adds as many triangles as meet
at the edge, which makes a bound on their number exact. No triangle is cut without its longest edge,
so that pieces do not get thin, however unevenly the surface is cut.

         2               2               2               2
        / \             /|\             / \             / \
       /   \           / | \           /  _4           5---4
      /     \         /  |  \         / _/ |\         / \ / \
     0-------1       0---3---1       0----3--1       0---3---1
    no cut           one             two             three

Each piece knows the base triangle it lies on and where its corners lie there. Those weights are
halves of halves, which float32 holds exactly for as many cuts as `MOST_CUTS`.

Based on: Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid
techniques", International Journal for Numerical Methods in Engineering 20, 1984 (longest edges);
Bank, Sherman, Weiser, "Refinement algorithms and data structures for regular local mesh
refinement", 1983 (a triangle with three cut edges).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

# An edge cut so many times is 2^-23 of itself: the finest that float32 weights tell apart.
MOST_CUTS = 23
# Triangles a band.
_BAND = 1 << 16

# How a triangle is cut, by the number of its cut edges, which come first; two edges have two ways.
# Points: its corners 0, 1, 2 and the middles 3, 4, 5 of its edges 01, 12, 20. Edges: the halves of
# 01 at corners 0 and 1 are 0 and 1, those of 12 are 2 and 3, those of 20 are 4 and 5 (both are the
# edge itself where it is not cut), and 6, 7, 8 are new ones inside.
_NO = (0, 0, 0, 0, 0, 0)
_PIECES = np.array(
    [  # three points, then the edges from each to the next
        [(0, 1, 2, 0, 2, 4), _NO, _NO, _NO],
        [(0, 3, 2, 0, 6, 4), (3, 1, 2, 1, 2, 6), _NO, _NO],
        [(3, 1, 4, 1, 2, 6), (0, 3, 4, 0, 6, 7), (0, 4, 2, 7, 3, 4), _NO],
        [(0, 3, 5, 0, 6, 5), (3, 1, 4, 1, 2, 7), (5, 4, 2, 8, 3, 4), (3, 4, 5, 7, 8, 6)],
        [(3, 1, 4, 1, 2, 6), (0, 3, 2, 0, 7, 4), (3, 4, 2, 6, 3, 7), _NO],
    ]
)
# Ends of the new edges 6, 7 and 8.
_INNER = np.array(
    [
        [(0, 0), (0, 0), (0, 0)],
        [(3, 2), (0, 0), (0, 0)],
        [(3, 4), (0, 4), (0, 0)],
        [(3, 5), (3, 4), (4, 5)],
        [(3, 4), (3, 2), (0, 0)],
    ]
)
_OTHER_DIAGONAL = 4

Floats = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Triangles with their edges.

    Attributes
    ----------
    n_vertices : int
    faces : (F, 3) int32
        Vertices, wound as the base triangle is.
    face_edges : (F, 3) int32
        Edge from each corner to the next.
    ends : (E, 2) int32
        Vertices of each edge.
    base_faces : (F,) int32
        Triangle that each is a piece of.
    base_weights : (F, 3, 2) float32
        Where its corners lie on that: weights of the second and third corner.
    """

    n_vertices: int
    faces: IntArray
    face_edges: IntArray
    ends: IntArray
    base_faces: IntArray
    base_weights: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Places on base triangles where vertices lie; those on an edge lie on several.

    Attributes
    ----------
    vertices : (S,) int32
        Vertex at each place, counted from the first new one.
    base_faces : (S,) int32
    weights : (S, 2) float32
        Of the second and third corner.
    """

    vertices: IntArray
    base_faces: IntArray
    weights: Floats


def uncut(faces: IntArray) -> tuple[Pieces, Places]:
    """Return triangles as they are, and the places of their vertices.

    Parameters
    ----------
    faces : (F, 3) int32
        Vertices 0 to V - 1, each of them used; edges that run between the same two are one.
    """
    n_faces, n_vertices = len(faces), int(faces.max()) + 1
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).astype(np.int64)
    keys = ends.min(axis=-1) * n_vertices + ends.max(axis=-1)
    edge_keys, face_edges = np.unique(keys, return_inverse=True)
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], np.float32)
    base_faces = np.arange(n_faces, dtype=np.int32)
    weights = np.tile(corners, (n_faces, 1, 1))
    pieces = Pieces(
        n_vertices=n_vertices,
        faces=np.array(faces, np.int32, order="C"),
        face_edges=np.ascontiguousarray(face_edges.reshape(-1, 3), np.int32),
        ends=np.stack(np.divmod(edge_keys, n_vertices), axis=1).astype(np.int32),
        base_faces=base_faces,
        base_weights=weights,
    )
    places = Places(
        vertices=pieces.faces.reshape(-1),
        base_faces=np.repeat(base_faces, 3),
        weights=weights.reshape(-1, 2),
    )
    return pieces, places


@kernel
def _squared_distance(a, b):  # type: ignore[no-untyped-def]
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


def edges_to_cut(pieces: Pieces, excess: FloatArray, points: FloatArray, most: int) -> Bools:
    """(E,) bool: edges to cut, as many as a bound on the triangles allows.

    Those that are too long, and with them the longest of every triangle that is cut; where that
    would be too many, only of the former those that are the most times too long.

    Parameters
    ----------
    pieces
        To be cut.
    excess : (E,) float64
        How many times too long each edge is; at most 1 for one that is short enough.
    points : (V, 3) float64
        Where vertices lie.
    most
        Bound on the triangles after the cut.
    """
    wanted = excess > 1.0
    wanted &= pieces.ends[:, 0] != pieces.ends[:, 1]  # a base edge of length 0 has no middle
    too_long = np.flatnonzero(wanted)
    room = most - len(pieces.faces)
    if _close_kernel(pieces.faces, pieces.face_edges, points, wanted) <= room:
        return wanted
    n_faces = np.bincount(pieces.face_edges.reshape(-1), minlength=len(pieces.ends))
    longest = too_long[np.argsort(-excess[too_long], kind="stable")]
    kept = np.zeros_like(wanted)
    kept[longest[np.cumsum(n_faces[longest]) <= room]] = True
    return kept


@kernel
def _close_kernel(faces, face_edges, points, marked):  # type: ignore[no-untyped-def]
    """Mark the longest edge of every triangle with a marked one; return how many cuts that is."""
    changed, n_cuts = True, 0
    while changed:
        changed, n_cuts = False, 0
        for i in range(len(faces)):
            n = 0
            for k in range(3):
                n += marked[face_edges[i, k]]
            if 0 < n < 3:
                longest, length = 0, -1.0
                for k in range(3):
                    squared = _squared_distance(points[faces[i, k]], points[faces[i, (k + 1) % 3]])
                    if squared > length:
                        longest, length = face_edges[i, k], squared
                if not marked[longest]:
                    marked[longest] = True
                    changed = True
                    n += 1
            n_cuts += n
    return n_cuts


def cut(
    pieces: Pieces, marked: Bools, points: FloatArray, *, threads: int | None = None
) -> tuple[Pieces, IntArray, Places]:
    """Cut edges in the middle, and the triangles that they belong to.

    Parameters
    ----------
    pieces
        Triangles.
    marked : (E,) bool
        Edges to cut.
    points : (V, 3) float64
        Where vertices lie, by which the shorter diagonal is found.
    threads
        None for every processor.

    Returns
    -------
    pieces : Pieces
        Pieces of one triangle follow one another, in the order of the triangles.
    ends : (M, 2) int32
        Vertices in the middle between which each new vertex lies.
    places : Places
        Of the new vertices.
    """
    n_marked = int(np.count_nonzero(marked))
    halves = np.cumsum(marked, dtype=np.int32) + np.arange(len(marked), dtype=np.int32) - marked
    middles = (pieces.n_vertices - 1 + np.cumsum(marked)).astype(np.int32)
    added = np.empty(len(pieces.faces) + 1, np.int64)
    _count_kernel(pieces.face_edges, marked, added)
    n_halves, n_inner = len(marked) + n_marked, int(added[-1])
    n_faces = len(pieces.faces) + n_inner
    finer = Pieces(
        n_vertices=pieces.n_vertices + n_marked,
        faces=np.empty((n_faces, 3), np.int32),
        face_edges=np.empty((n_faces, 3), np.int32),
        ends=np.empty((n_halves + n_inner, 2), np.int32),
        base_faces=np.empty(n_faces, np.int32),
        base_weights=np.empty((n_faces, 3, 2), np.float32),
    )
    places = Places(
        vertices=np.empty(n_inner, np.int32),
        base_faces=np.empty(n_inner, np.int32),
        weights=np.empty((n_inner, 2), np.float32),
    )
    _halve_kernel(pieces.ends, marked, halves, middles, finer.ends)

    def work(start: int, stop: int) -> None:
        _cut_kernel(
            (pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights),
            (pieces.ends, marked, halves, middles), points, added, n_halves, pieces.n_vertices,
            (finer.faces, finer.face_edges, finer.base_faces, finer.base_weights), finer.ends,
            (places.vertices, places.base_faces, places.weights), start, stop,
        )  # fmt: skip

    run_bands(work, len(pieces.faces), band=_BAND, threads=threads)
    return finer, pieces.ends[marked], places


@kernel
def _count_kernel(face_edges, marked, added):  # type: ignore[no-untyped-def]
    """Write how many pieces all triangles before each one become more."""
    added[0] = 0
    for i in range(len(face_edges)):
        n = np.int64(marked[face_edges[i, 0]]) + marked[face_edges[i, 1]]
        added[i + 1] = added[i] + n + marked[face_edges[i, 2]]


@kernel
def _halve_kernel(ends, marked, halves, middles, out):  # type: ignore[no-untyped-def]
    for edge in range(len(ends)):
        half = halves[edge]
        out[half, 0], out[half, 1] = ends[edge, 0], ends[edge, 1]
        if marked[edge]:
            out[half, 1] = middles[edge]
            out[half + 1, 0], out[half + 1, 1] = middles[edge], ends[edge, 1]


@kernel
def _gather(i, first, whole, edges, n_vertices, vertex, weight, edge, places, place):  # type: ignore[no-untyped-def]
    """Write the points and outer edges of a triangle, from its corner `first` on.

    Its cut edges get a row of the places of new vertices each, from row `place` on.
    """
    faces, face_edges, base_faces, weights = whole
    ends, marked, halves, middles = edges
    for k in range(3):
        corner, after = (first + k) % 3, (first + k + 1) % 3
        e = face_edges[i, corner]
        vertex[k] = faces[i, corner]
        for c in range(2):
            weight[k, c] = weights[i, corner, c]
            weight[3 + k, c] = np.float32(0.5) * (weights[i, corner, c] + weights[i, after, c])
        edge[2 * k], edge[2 * k + 1] = halves[e], halves[e]
        if marked[e]:
            vertex[3 + k] = middles[e]
            edge[2 * k + (ends[e, 0] == faces[i, corner])] += 1
            places[0][place] = middles[e] - n_vertices
            places[1][place] = base_faces[i]
            places[2][place, 0], places[2][place, 1] = weight[3 + k, 0], weight[3 + k, 1]
            place += 1


@kernel
def _keep(i, piece, whole, halves, out):  # type: ignore[no-untyped-def]
    """Copy a triangle without cut edges, as most are in the last rounds."""
    out[2][piece] = whole[2][i]
    for k in range(3):
        out[0][piece, k] = whole[0][i, k]
        out[1][piece, k] = halves[whole[1][i, k]]
        out[3][piece, k, 0], out[3][piece, k, 1] = whole[3][i, k, 0], whole[3][i, k, 1]


@kernel
def _cut_kernel(  # type: ignore[no-untyped-def]
    whole, edges, points, added, n_halves, n_vertices, out, ends_out, places, start, stop
):
    face_edges, marked = whole[1], edges[1]
    vertex, weight = np.zeros(6, np.int32), np.empty((6, 2), np.float32)
    edge, middle = np.empty(9, np.int32), np.empty((2, 3))
    for i in range(start, stop):
        case, first = added[i + 1] - added[i], 0
        if case == 0:
            _keep(i, i + added[i], whole, edges[2], out)
            continue
        if case == 1:
            while not marked[face_edges[i, first]]:
                first += 1
        elif case == 2:
            while marked[face_edges[i, (first + 2) % 3]]:
                first += 1
        _gather(i, first, whole, edges, n_vertices, vertex, weight, edge, places, added[i])
        if case == 2:
            a, b, c = points[vertex[0]], points[vertex[1]], points[vertex[2]]
            for k in range(3):
                middle[0, k], middle[1, k] = 0.5 * (a[k] + b[k]), 0.5 * (b[k] + c[k])
            if _squared_distance(middle[0], c) < _squared_distance(a, middle[1]):
                case = _OTHER_DIAGONAL
        n_inner = added[i + 1] - added[i]
        for k in range(n_inner):
            edge[6 + k] = n_halves + added[i] + k
            ends_out[edge[6 + k], 0] = vertex[_INNER[case, k, 0]]
            ends_out[edge[6 + k], 1] = vertex[_INNER[case, k, 1]]
        for k in range(n_inner + 1):
            piece = i + added[i] + k
            out[2][piece] = whole[2][i]
            for corner in range(3):
                point = _PIECES[case, k, corner]
                out[0][piece, corner] = vertex[point]
                out[1][piece, corner] = edge[_PIECES[case, k, 3 + corner]]
                out[3][piece, corner, 0] = weight[point, 0]
                out[3][piece, corner, 1] = weight[point, 1]
