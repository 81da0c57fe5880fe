"""Displacement: triangles are subdivided until they resolve a map, and their vertices moved by it.

A vertex moves along the smooth normal of the surface, interpolated linearly and then normalized:
the direction that displacement maps are baked along. Or, by a map of vectors, anywhere.

The surface stays closed. Vertices are shared by all triangles that meet at a position, whatever
texture coordinates they have there, and where those differ (at a seam) the vertex moves by the mean
of what the map holds for each. `texbake.rendering.tessellation` cuts the edges. The caller of
`displaced` chooses which: by their length in the picture (`EdgeView`), or by the texels of the map
alone (`MapView`).

The length of an edge in the picture is that of an edge seen from the side, so that relief on a
surface that is seen edge-on is not lost:

    f |ab| max(1/cos a, 1/cos b) / min(z_a, z_b)

with z the depth, f the distance of the picture in pixels, and a and b the angles of sight off its
axis. That is at least the distance of the points in the picture, because depth is linear along an
edge and the cone of directions within an angle is convex. The edge is measured on the surface and
where the map moves it, and the longer counts. Triangles that cannot be moved into the picture are
not measured.

Based on: Cook, "Shade trees", SIGGRAPH 1984; Cook, Carpenter, Catmull, "The Reyes image rendering
architecture", SIGGRAPH 1987, for pieces as small as what is to be seen. Departs from them in that
pieces share their corners, so that there is nothing to stitch. Cantlay, "DirectX 11 terrain
tessellation", NVIDIA, 2011, for a length that does not depend on how an edge is turned.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.rendering.camera import Camera
from texbake.rendering.kernels.displacement import (
    measure_excess,
    measure_texel_lengths,
    move_vertices,
    take_middles,
    view_vertices,
)
from texbake.rendering.options import RenderOptions
from texbake.rendering.tessellation import (
    MOST_CUTS,
    Pieces,
    Places,
    cut,
    edges_to_cut,
    uncut,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseSurface:
    """What is displaced.

    Attributes
    ----------
    points : (V, 3) float64
        In the space of the result. Vertices at bit-equal ones are one.
    faces : (F, 3) int32
    normals : (V, 3) float64
        Smooth normals, equal where positions are, in the space of the map.
    linear : (3, 3) float64
        From that space to the one of the result.
    """

    points: FloatArray
    faces: IntArray
    normals: FloatArray
    linear: FloatArray


@dataclass(frozen=True, eq=False)
class Displaced:
    """A surface, subdivided and displaced.

    Attributes
    ----------
    pieces : Pieces
    points : (V, 3) float64
        Where vertices lie on the surface.
    normals : (V, 3) float64
        Of the surface, interpolated, of any length.
    positions : (V, 3) float64
        Where they are moved to.
    """

    pieces: Pieces
    points: FloatArray
    normals: FloatArray
    positions: FloatArray


# Places of new vertices, and where those lie on the surface, to (S, 1) signed lengths along the
# normal or (S, 3) vectors, one a place.
Moves = Callable[[Places, FloatArray], FloatArray]

# How many times too long each edge is; at most 1 for one that is short enough.
Excess = Callable[[Displaced], FloatArray]


def displaced(
    surface: BaseSurface,
    moves: Moves,
    excess: Excess,
    *,
    max_triangles: int,
    threads: int | None = None,
) -> Displaced:
    """Cut a surface where its edges are too long, and move all vertices.

    Parameters
    ----------
    surface
        In any space.
    moves
        What the map says; called once for every place.
    excess
        Asked after each round of cuts, in which no edge is cut twice.
    max_triangles
        Bound on the pieces; where it is reached the longest edges have been cut.
    threads
        None for every processor.
    """
    welded = weld_rows(surface.points, threads=threads)
    used, faces = np.unique(welded[surface.faces], return_inverse=True)
    pieces, places = uncut(faces.reshape(-1, 3).astype(np.int32))
    points, normals = surface.points[used], surface.normals[used]
    now = Displaced(pieces, points, normals, _moved(surface, points, normals, places, moves))
    for _ in range(MOST_CUTS):
        marked = edges_to_cut(pieces, excess(now), now.points, max_triangles)
        if not marked.any():
            break
        pieces, ends, places = cut(pieces, marked, now.points, threads=threads)
        points, normals = np.empty((len(ends), 3)), np.empty((len(ends), 3))
        take_middles(now.points, ends, points)
        take_middles(now.normals, ends, normals)
        positions = _moved(surface, points, normals, places, moves)
        now = Displaced(
            pieces,
            np.concatenate([now.points, points]),
            np.concatenate([now.normals, normals]),
            np.concatenate([now.positions, positions]),
        )
    return now


def _moved(
    surface: BaseSurface, points: FloatArray, normals: FloatArray, places: Places, moves: Moves
) -> FloatArray:
    """Vertices moved by the mean of what the map holds at their places.

    One without a normal does not move along it.
    """
    positions = np.empty((len(points), 3))
    move_vertices(
        places.vertices, moves(places, points), points, normals,
        np.ascontiguousarray(surface.linear, np.float64), positions,
    )  # fmt: skip
    return positions


def texel_lengths(
    pieces: Pieces, texels: FloatArray | None, outside: npt.NDArray[np.uint8]
) -> FloatArray:
    """(E,) float64: how many texels each edge spans, in that of its triangles where it spans most.

    Parameters
    ----------
    pieces
        Triangles.
    texels : (F, 3, 2) float64, optional
        Corners of the base triangles on the map, in texels; None: the map is as fine as one looks.
    outside : (V,) uint8
        Sides of the picture, a bit each, outside of which a vertex certainly moves. A triangle all
        of whose vertices are outside of the same one does not count.
    """
    lengths = np.zeros(len(pieces.ends))
    corners = np.empty((0, 3, 2)) if texels is None else texels
    measure_texel_lengths(
        pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights, corners, outside,
        lengths,
    )  # fmt: skip
    return lengths


# Vertices or edges a band.
_BAND = 1 << 15


class EdgeView:
    """How long edges may be in a picture from one camera.

    Parameters
    ----------
    camera
        Where the picture is taken from.
    options
        `width` and `height` are taken from them.
    edge_px
        Longest edge that is short enough, in pixels.
    farthest
        Farthest that a point is moved, in world space.
    """

    def __init__(
        self, camera: Camera, options: RenderOptions, edge_px: float, farthest: float
    ) -> None:
        tall = math.tan(camera.fov / 2)
        wide = tall * options.width / options.height
        x, y, z, w = camera.clip_from_world(options.width / options.height)
        self._camera = camera
        self._edge_px = edge_px
        self._focal = options.height / (2.0 * tall)
        # Greater than 0 inside the picture, by as much as is to its left, right, bottom, top, and
        # between it and the eye.
        self._sides = np.stack([w + x, w - x, w + y, w - y, w - z])
        # How far outside of a side a point must be that is not moved into the picture.
        self._margins = farthest * np.linalg.norm(self._sides[:, :3], axis=1)
        # 1 over the cosine of the angle of sight of the picture's corners.
        self._steepest = math.sqrt(1.0 + wide * wide + tall * tall)

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): world length, at points, of the shortest pieces: half of `edge_px` pixels."""
        depths = (self._camera.eye - points) @ self._camera.axes[2]
        nearest = np.maximum(depths, self._camera.near)
        return np.asarray(nearest * (0.5 * self._edge_px / self._focal))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """How many times longer edges are than they may be.

        Parameters
        ----------
        now
            A surface, as finely as it has been cut.
        texels : (F, 3, 2) float64, optional
            As in `texel_lengths`.
        threads
            None for every processor.

        Returns
        -------
        (E,) float64
            0 where an edge needs no cut, because it spans at most a texel or is not seen.
        """
        n = len(now.points)
        outside, nearest, slants = np.empty(n, np.uint8), np.empty(n), np.empty(n)

        def look(start: int, stop: int) -> None:
            view_vertices(
                now.points, now.positions, self._camera.eye, self._camera.axes[2],
                self._camera.near, self._steepest, self._sides, self._margins,
                outside, nearest, slants, start, stop,
            )  # fmt: skip

        run_bands(look, n, band=_BAND, threads=threads)
        spans = texel_lengths(now.pieces, texels, outside)
        out = np.empty(len(spans))

        def measure(start: int, stop: int) -> None:
            measure_excess(
                now.pieces.ends, now.points, now.positions, nearest, slants, spans,
                self._focal / self._edge_px, out, start, stop,
            )  # fmt: skip

        run_bands(measure, len(out), band=_BAND, threads=threads)
        return out


class MapView:
    """How long edges may be for any camera: a texel of the map."""

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): 0, so that maps are read as finely as they are."""
        return np.zeros(len(points))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """(E,): how many texels each edge spans."""
        return texel_lengths(now.pieces, texels, np.zeros(len(now.points), np.uint8))
