r"""Displacement: triangles are subdivided until they resolve a map, and their vertices are moved.

A height moves a vertex along the surface's smooth normal, interpolated linearly and then
normalized; displacement maps are baked along the same direction. A vector map moves it anywhere.

The surface stays watertight. Triangles that meet at a position share a vertex, whatever their
texture coordinates; at a UV seam the vertex moves by the mean of the map's values on all sides.
The caller of `displaced` chooses which edges are too long: by their length in the picture
(`EdgeView`), or by the texels of the map alone (`texel_lengths`).

Edges that are too long are cut in the middle, the longest of a triangle at least, so that pieces do
not become thin. The triangles on both sides of an edge agree on its vertices, so no cracks open.

         2               2               2               2
        / \             /|\             / \             / \
       /   \           / | \           /  _4           5---4
      /     \         /  |  \         / _/ |\         / \ / \
     0-------1       0---3---1       0----3--1       0---3---1
    no cut           one             two             three

Each piece stores its base triangle and the barycentric weights of its corners there. After k cuts
the weights are multiples of 2^-k, which float32 holds exactly for up to `MOST_CUTS` cuts.

The length of an edge in the picture is measured as if it were seen from the side, so that relief
on a surface seen edge-on is not lost:

    f |ab| max(1/cos a, 1/cos b) / min(z_a, z_b)

with z the depth, f the focal length in pixels, and a and b the angles between the view axis and the
rays to the two ends. This is an upper bound on the projected length, because depth is linear along
an edge and a cone around the axis is convex. The edge is measured both on the surface and after
displacement, and the longer length counts. Triangles that displacement cannot move into the picture
are not measured.

Based on: Cook, "Shade trees", SIGGRAPH 1984; Cook, Carpenter, Catmull, "The Reyes image rendering
architecture", SIGGRAPH 1987, for dicing by size on the screen; here pieces share their corners, so
no cracks can open. Cantlay, "DirectX 11 terrain tessellation", NVIDIA, 2011, for a length that does
not depend on the orientation of an edge. Rivara, "Algorithms for refining triangular grids suitable
for adaptive and multigrid techniques", International Journal for Numerical Methods in Engineering
20, 1984 (longest edges); Bank, Sherman, Weiser, "Refinement algorithms and data structures for
regular local mesh refinement", 1983 (a triangle with three cut edges).

Kernel: `core/displacement.c`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions

# After this many cuts an edge is 2^-23 of its original length, the resolution of float32 weights.
MOST_CUTS = 23
# Triangles per band of cutting; vertices or edges per band of measuring.
_CUT_BAND, _BAND = 1 << 16, 1 << 15


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Triangles with their edges."""

    n_vertices: int
    faces: IntArray  # (F, 3): vertices, with the winding of the base triangle
    face_edges: IntArray  # (F, 3): edge from each corner to the next
    ends: IntArray  # (E, 2): vertices of each edge
    base_faces: IntArray  # (F,): base triangle of each piece
    # (F, 3, 2): positions of the piece's corners on it, as weights of its second and third corner
    base_weights: Float32Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Positions of vertices on base triangles; one on their common edge has a place on each."""

    vertices: IntArray  # (S,): vertex at each place, counted from the first new one
    base_faces: IntArray  # (S,)
    weights: Float32Array  # (S, 2): weights of the second and third corner


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


def edges_to_cut(pieces: Pieces, excess: FloatArray, points: FloatArray, most: int) -> BoolArray:
    """(E,) too long edges and the longest of each cut triangle, worst first, up to `most` faces."""
    wanted = excess > 1.0
    wanted &= pieces.ends[:, 0] != pieces.ends[:, 1]  # a base edge of length 0 has no middle
    too_long = np.flatnonzero(wanted)
    room = most - len(pieces.faces)
    # Each cut edge adds a triangle or more.
    is_enough = len(too_long) <= room
    if is_enough and core.close_marks(pieces.faces, pieces.face_edges, points, wanted) <= room:
        return wanted
    if 0 < room < len(too_long):
        least = np.sort(excess[too_long])[-room]
        too_long = too_long[excess[too_long] >= least]
    n_faces = np.bincount(pieces.face_edges.reshape(-1), minlength=len(pieces.ends))
    longest = too_long[np.argsort(-excess[too_long], kind="stable")]
    kept = np.zeros_like(wanted)
    kept[longest[np.cumsum(n_faces[longest]) <= room]] = True
    return kept


def cut(
    pieces: Pieces, marked: BoolArray, points: FloatArray, *, threads: int | None = None
) -> tuple[Pieces, IntArray, Places]:
    """Halve marked edges (E,): pieces in order, ends (M, 2) of new vertices, and their places."""
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
    kernel = partial(
        core.cut_triangles, pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights,
        pieces.ends, marked, halves, middles, points, added, n_halves, pieces.n_vertices,
        finer.faces, finer.face_edges, finer.base_faces, finer.base_weights, finer.ends,
        places.vertices, places.base_faces, places.weights,
    )  # fmt: skip
    run_bands(kernel, len(pieces.faces), band=_CUT_BAND, threads=threads)
    n_kept = core.drop_repeated_places(n_marked, places.vertices, places.base_faces, places.weights)
    places = Places(
        vertices=places.vertices[:n_kept],
        base_faces=places.base_faces[:n_kept],
        weights=places.weights[:n_kept],
    )
    return finer, pieces.ends[marked], places


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseSurface:
    """A surface before subdivision and displacement."""

    # (V, 3): positions in the space of the result, each bit-equal position only once
    points: FloatArray
    faces: IntArray  # (F, 3)
    normals: FloatArray  # (V, 3): smooth normals in the space of the map, one per position
    linear: FloatArray  # (3, 3): transforms vectors from the map's space to that of the result


@dataclass(frozen=True, eq=False)
class Displaced:
    """A surface, subdivided and displaced."""

    pieces: Pieces
    points: FloatArray  # (V, 3): vertices on the undisplaced surface
    normals: FloatArray  # (V, 3): interpolated normals of the surface, of any length
    positions: FloatArray  # (V, 3): vertices after displacement


# Maps places of new vertices and their points on the surface to displacements, one per place:
# (S, 1) signed lengths along the normal, or (S, 3) vectors.
Moves = Callable[[Places, FloatArray], FloatArray]
# Ratio of each edge's length to the allowed length; at most 1 for an edge that is short enough.
Excess = Callable[[Displaced], FloatArray]


def displaced(
    surface: BaseSurface,
    moves: Moves,
    excess: Excess,
    *,
    max_triangles: int,
    threads: int | None = None,
) -> Displaced:
    """Subdivide a surface where its edges are too long, and displace all vertices."""
    welded = weld_rows(surface.points, threads=threads)
    used, faces = np.unique(welded[surface.faces], return_inverse=True)
    pieces, places = undivided_triangles(faces.reshape(-1, 3).astype(np.int32))
    points, normals = surface.points[used], surface.normals[used]
    now = Displaced(
        pieces, points, normals, _move_vertices(surface, points, normals, places, moves)
    )
    for _ in range(MOST_CUTS):
        if len(pieces.faces) >= max_triangles:
            break
        marked = edges_to_cut(pieces, excess(now), now.points, max_triangles)
        if not marked.any():
            break
        pieces, ends, places = cut(pieces, marked, now.points, threads=threads)
        points, normals = np.empty((len(ends), 3)), np.empty((len(ends), 3))
        core.take_middles(now.points, ends, points)
        core.take_middles(now.normals, ends, normals)
        positions = _move_vertices(surface, points, normals, places, moves)
        now = Displaced(
            pieces,
            np.concatenate([now.points, points]),
            np.concatenate([now.normals, normals]),
            np.concatenate([now.positions, positions]),
        )
    return now


def _move_vertices(
    surface: BaseSurface, points: FloatArray, normals: FloatArray, places: Places, moves: Moves
) -> FloatArray:
    """Move vertices by the mean displacement of their places; by heights only along a normal."""
    positions = np.empty((len(points), 3))
    core.move_vertices(
        places.vertices, moves(places, points), points, normals,
        np.ascontiguousarray(surface.linear, np.float64), positions,
    )  # fmt: skip
    return positions


def texel_lengths(pieces: Pieces, texels: FloatArray | None, outside: ByteArray) -> FloatArray:
    """(E,) longest texels of each edge over its base triangles (F, 3, 2) not outside one side."""
    lengths = np.zeros(len(pieces.ends))
    core.measure_texel_lengths(
        pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights, texels, outside,
        lengths,
    )  # fmt: skip
    return lengths


class EdgeView:
    """Limits edges to `edge_px` pixels for a camera; `farthest` bounds the displacement (world)."""

    def __init__(
        self, camera: Camera, options: RenderOptions, edge_px: float, farthest: float
    ) -> None:
        tall = pm.tan(camera.fov / 2)
        wide = tall * options.width / options.height
        x, y, z, w = camera.clip_from_world(options.width / options.height)
        self._camera = camera
        self._edge_px = edge_px
        self._focal = options.height / (2.0 * tall)
        # Planes of the left, right, bottom and top side and of the near plane; positive inside.
        self._sides = np.stack([w + x, w - x, w + y, w - y, w - z])
        # A point farther outside a plane than this cannot be moved into the picture.
        self._margins = farthest * pm.norm(self._sides[:, :3], axis=1)
        # 1 / cosine of the angle between the view axis and the picture's corners.
        self._steepest = math.sqrt(1.0 + wide * wide + tall * tall)

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): world length at points of half of `edge_px` pixels, the shortest edges."""
        depths = pm.matmul(self._camera.eye - points, self._camera.axes[2])
        nearest = np.maximum(depths, self._camera.near)
        return np.asarray(nearest * (0.5 * self._edge_px / self._focal))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """(E,) ratio of edges to the allowed length; 0 where a cut would show nothing more."""
        n = len(now.points)
        outside, nearest, slants = np.empty(n, np.uint8), np.empty(n), np.empty(n)
        kernel = partial(
            core.view_vertices, now.points, now.positions, self._camera.eye, self._camera.axes[2],
            self._camera.near, self._steepest, self._sides, self._margins, outside, nearest, slants,
        )  # fmt: skip
        run_bands(kernel, n, band=_BAND, threads=threads)
        spans = texel_lengths(now.pieces, texels, outside)
        out = np.empty(len(spans))
        kernel = partial(
            core.measure_excess, now.pieces.ends, now.points, now.positions, nearest, slants, spans,
            self._focal / self._edge_px, out,
        )  # fmt: skip
        run_bands(kernel, len(out), band=_BAND, threads=threads)
        return out
