"""Real displacement: triangles cut until they resolve a map, and moved by it.

A vertex moves along the smooth normal of the surface, interpolated linearly and then normalized:
the direction that displacement maps are baked along. Or, by a map of vectors, anywhere.

The surface stays closed. Vertices are shared by all triangles that meet at a position, whatever
texture coordinates they have there, and where those differ (at a seam) the vertex moves by the mean
of what the map holds for each. How edges are cut is said in `texbake.rendering.tessellation`; which
ones, by whoever calls `displaced`: by what a camera sees of them, or by the texels of a map alone.

Based on: Cook, "Shade trees", SIGGRAPH 1984; Cook, Carpenter, Catmull, "The Reyes image rendering
architecture", SIGGRAPH 1987, for pieces as small as what is to be seen. Departs from them in that
pieces share their corners, so that there is nothing to stitch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows
from texbake.rendering.tessellation import (
    MOST_CUTS,
    Pieces,
    Places,
    cut,
    edges_to_cut,
    uncut,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """What is displaced.

    Attributes
    ----------
    points : (V, 3) float64
        In the space of the result. Vertices at bit-equal ones are one.
    faces : (F, 3) int32
    normals : (V, 3) float64
        Smooth normals, equal where positions are, in the space that the map is told in.
    linear : (3, 3) float64
        From that space to the one of the result.
    """

    points: FloatArray
    faces: IntArray
    normals: FloatArray
    linear: FloatArray


@dataclass(frozen=True, eq=False)
class Displaced:
    """A surface cut and moved.

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
    surface: Surface,
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
        What the map says; asked once for every place.
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
        _middle_kernel(now.points, ends, points)
        _middle_kernel(now.normals, ends, normals)
        positions = _moved(surface, points, normals, places, moves)
        now = Displaced(
            pieces,
            np.concatenate([now.points, points]),
            np.concatenate([now.normals, normals]),
            np.concatenate([now.positions, positions]),
        )
    return now


def _moved(
    surface: Surface, points: FloatArray, normals: FloatArray, places: Places, moves: Moves
) -> FloatArray:
    """Vertices moved by the mean of what the map holds at their places.

    One without a normal does not move along it.
    """
    positions = np.empty((len(points), 3))
    _move_kernel(
        places.vertices, moves(places, points), points, normals,
        np.ascontiguousarray(surface.linear, np.float64), positions,
    )  # fmt: skip
    return positions


@kernel
def _middle_kernel(values, ends, out):  # type: ignore[no-untyped-def]
    for i in range(len(ends)):
        for k in range(3):
            out[i, k] = 0.5 * (values[ends[i, 0], k] + values[ends[i, 1], k])


@kernel
def _move_kernel(vertices, values, points, normals, linear, out):  # type: ignore[no-untyped-def]
    n_channels = values.shape[1]
    counts, way = np.zeros(len(points), np.int32), np.empty(3)
    out[:] = 0.0
    for i in range(len(vertices)):
        counts[vertices[i]] += 1
        for k in range(n_channels):
            out[vertices[i], k] += values[i, k]
    for i in range(len(points)):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        for k in range(3):
            if n_channels == 3:
                way[k] = out[i, k] / counts[i]
            else:
                way[k] = out[i, 0] / counts[i] * (normals[i, k] / length if length > 0.0 else 0.0)
        for k in range(3):
            turned = linear[k, 0] * way[0] + linear[k, 1] * way[1] + linear[k, 2] * way[2]
            out[i, k] = points[i, k] + turned


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
    _texel_kernel(
        pieces.faces, pieces.face_edges, pieces.base_faces, pieces.base_weights, corners, outside,
        lengths,
    )  # fmt: skip
    return lengths


@kernel
def _texel_kernel(faces, face_edges, base_faces, weights, corners, outside, lengths):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        if outside[faces[i, 0]] & outside[faces[i, 1]] & outside[faces[i, 2]]:
            continue
        for k in range(3):
            length, edge, after = np.inf, face_edges[i, k], (k + 1) % 3
            if len(corners) > 0:
                a, b, c = corners[base_faces[i]]
                along = np.float64(weights[i, after, 0] - weights[i, k, 0])
                up = np.float64(weights[i, after, 1] - weights[i, k, 1])
                x = along * (b[0] - a[0]) + up * (c[0] - a[0])
                y = along * (b[1] - a[1]) + up * (c[1] - a[1])
                length = np.sqrt(x * x + y * y)
            lengths[edge] = max(lengths[edge], length)
