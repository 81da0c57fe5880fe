r"""Adaptive subdivision of triangles, without cracks.

Edges that are too long are cut in the middle. A triangle is then divided into two, three or four
pieces, depending on which of its edges were cut. The triangles on both sides of an edge always
agree on its vertices, so no cracks open. Each cut adds one triangle for each triangle at the edge,
so a limit on their number can be kept exactly. A triangle is never cut without its longest edge, so
that pieces do not become thin, however unevenly the surface is subdivided.

         2               2               2               2
        / \             /|\             / \             / \
       /   \           / | \           /  _4           5---4
      /     \         /  |  \         / _/ |\         / \ / \
     0-------1       0---3---1       0----3--1       0---3---1
    no cut           one             two             three

Each piece stores its base triangle and the barycentric weights of its corners there. After k cuts
the weights are multiples of 2^-k, which float32 holds exactly for up to `MOST_CUTS` cuts.

Based on: Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid
techniques", International Journal for Numerical Methods in Engineering 20, 1984 (longest edges);
Bank, Sherman, Weiser, "Refinement algorithms and data structures for regular local mesh
refinement", 1983 (a triangle with three cut edges).

Kernel: `core/triangle_cutting.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

# After this many cuts an edge is 2^-23 of its original length, the resolution of float32 weights.
MOST_CUTS = 23
# Triangles per band.
_BAND = 1 << 16
Floats = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Triangles with their edges."""

    n_vertices: int
    faces: IntArray  # (F, 3): vertices, with the winding of the base triangle
    face_edges: IntArray  # (F, 3): edge from each corner to the next
    ends: IntArray  # (E, 2): vertices of each edge
    base_faces: IntArray  # (F,): base triangle of each piece
    # (F, 3, 2): positions of the piece's corners on it, as weights of its second and third corner
    base_weights: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Positions of vertices on base triangles; a vertex on an edge has one place per triangle."""

    vertices: IntArray  # (S,): vertex at each place, counted from the first new one
    base_faces: IntArray  # (S,)
    weights: Floats  # (S, 2): weights of the second and third corner


def undivided_triangles(faces: IntArray) -> tuple[Pieces, Places]:
    """Return triangles (F, 3) without any cut, and the places of their vertices."""
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


def edges_to_cut(pieces: Pieces, excess: FloatArray, points: FloatArray, most: int) -> Bools:
    """(E,) bool: edges to cut, as many as a limit on the number of triangles allows.

    Selects the edges that are too long, and the longest edge of every triangle that is cut. If
    these are too many, the edges that exceed their limit the most come first.

    `excess` (E,) float64: ratio of each edge's length to the allowed length; `points` (V, 3)
    float64; `most`: maximum number of triangles after the cut.
    """
    wanted = excess > 1.0
    wanted &= pieces.ends[:, 0] != pieces.ends[:, 1]  # a base edge of length 0 has no middle
    too_long = np.flatnonzero(wanted)
    room = most - len(pieces.faces)
    if core.close_marks(pieces.faces, pieces.face_edges, points, wanted) <= room:
        return wanted
    n_faces = np.bincount(pieces.face_edges.reshape(-1), minlength=len(pieces.ends))
    longest = too_long[np.argsort(-excess[too_long], kind="stable")]
    kept = np.zeros_like(wanted)
    kept[longest[np.cumsum(n_faces[longest]) <= room]] = True
    return kept


def cut(
    pieces: Pieces, marked: Bools, points: FloatArray, *, threads: int | None = None
) -> tuple[Pieces, IntArray, Places]:
    """Cut edges in the middle, and subdivide the triangles that they belong to.

    `marked` (E,) bool; `points` (V, 3) float64: used to choose the shorter diagonal. Returns the
    pieces, those of each triangle together; `ends` (M, 2) int32: the two vertices whose midpoint
    each new vertex is; and the places of the new vertices.
    """
    n_marked = int(np.count_nonzero(marked))
    halves = np.cumsum(marked, dtype=np.int32) + np.arange(len(marked), dtype=np.int32) - marked
    middles = (pieces.n_vertices - 1 + np.cumsum(marked)).astype(np.int32)
    added = np.empty(len(pieces.faces) + 1, np.int64)
    core.count_pieces(pieces.face_edges, marked, added)
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
    core.halve_edges(pieces.ends, marked, halves, middles, finer.ends)

    def work(start: int, stop: int) -> None:
        core.cut_triangles(
            pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights,
            pieces.ends, marked, halves, middles, points, added, n_halves, pieces.n_vertices,
            finer.faces, finer.face_edges, finer.base_faces, finer.base_weights, finer.ends,
            places.vertices, places.base_faces, places.weights, start, stop,
        )  # fmt: skip

    run_bands(work, len(pieces.faces), band=_BAND, threads=threads)
    return finer, pieces.ends[marked], places
