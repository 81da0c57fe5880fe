"""Displacement: triangles are subdivided until they resolve a map, and their vertices are moved.

A height moves a vertex along the surface's smooth normal, interpolated linearly and then
normalized; displacement maps are baked along the same direction. A vector map moves it anywhere.

The surface stays watertight. Triangles that meet at a position share a vertex, whatever their
texture coordinates; at a UV seam the vertex moves by the mean of the map's values on all sides.
`texbake.rendering.tessellation` subdivides. The caller of `displaced` chooses which edges are too
long: by their length in the picture (`EdgeView`), or by the texels of the map alone (`MapView`).

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
not depend on the orientation of an edge.

Kernel: `core/displacement.c`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.tessellation import (
    MOST_CUTS,
    Pieces,
    Places,
    cut,
    edges_to_cut,
    undivided_triangles,
)


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


def texel_lengths(
    pieces: Pieces, texels: FloatArray | None, outside: npt.NDArray[np.uint8]
) -> FloatArray:
    """(E,) float64: length of each edge in texels, the maximum over its triangles.

    `texels` (F, 3, 2) float64: corners of the base triangles on the map, in texels; None for a map
    of unlimited detail; `outside` (V,) uint8: a bit for each side of the picture that a vertex is
    outside of. Triangles that are entirely outside of one side are ignored.
    """
    lengths = np.zeros(len(pieces.ends))
    core.measure_texel_lengths(
        pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights, texels, outside,
        lengths,
    )  # fmt: skip
    return lengths


# Vertices or edges per band.
_BAND = 1 << 15


class EdgeView:
    """Limits the length of edges in the picture of one camera.

    `edge_px`: maximum length of an edge in pixels; `farthest`: upper bound on the displacement in
    world space.
    """

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
        """Ratio of each edge's length to the allowed length.

        `texels` (F, 3, 2) float64: as in `texel_lengths`. Returns (E,) float64: 0 for an edge that
        need not be cut, because it spans at most a texel or is not visible.
        """
        n = len(now.points)
        outside, nearest, slants = np.empty(n, np.uint8), np.empty(n), np.empty(n)

        def look(start: int, stop: int) -> None:
            core.view_vertices(
                now.points, now.positions, self._camera.eye, self._camera.axes[2],
                self._camera.near, self._steepest, self._sides, self._margins,
                outside, nearest, slants, start, stop,
            )  # fmt: skip

        run_bands(look, n, band=_BAND, threads=threads)
        spans = texel_lengths(now.pieces, texels, outside)
        out = np.empty(len(spans))

        def measure(start: int, stop: int) -> None:
            core.measure_excess(
                now.pieces.ends, now.points, now.positions, nearest, slants, spans,
                self._focal / self._edge_px, out, start, stop,
            )  # fmt: skip

        run_bands(measure, len(out), band=_BAND, threads=threads)
        return out


class MapView:
    """Limits the length of edges to a texel of the map, for any camera."""

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): 0, so that maps are read at full resolution."""
        return np.zeros(len(points))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """(E,): length of each edge in texels."""
        return texel_lengths(now.pieces, texels, np.zeros(len(now.points), np.uint8))
