"""Triangles of polygons, and the polygons of a mesh of triangles.

docs/reference/formats.md says how polygons are cut. All decisions on sides are exact, in the plane
of the two axes that are farthest from the polygon's normal. Kernel: `core/ear_clipping.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core
from texbake.errors import counted, warn_of
from texbake.files import PathLike
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass

_BAND = 1 << 14  # polygons


def polygon_of_triangles(sizes: AnyArray) -> Int64Array:
    """(F,) the polygon of each triangle: a polygon of n corners has n - 2, none if n < 3."""
    return np.repeat(np.arange(len(sizes)), np.maximum(sizes.astype(np.int64) - 2, 0))


def next_corners(sizes: Int64Array) -> Int64Array:
    """(C,) corner that follows each one in its polygon; (P,) sizes are numbers of corners."""
    sizes = sizes[sizes > 0]
    following = np.arange(1, sizes.sum() + 1)
    ends = np.cumsum(sizes)
    following[ends - 1] = ends - sizes
    return following


def triangulated(
    path: PathLike, positions: FloatArray, vertices: AnyArray, sizes: AnyArray
) -> tuple[Int64Array, Int64Array]:
    """Cut polygons into triangles: corners (F, 3) and the polygon (F,) of each; warn of bad ones.

    Those of a simple polygon fill it without overlap; straight corners stay where they can.
    """
    sizes = sizes.astype(np.int64)
    if (sizes == 3).all():
        return np.arange(len(vertices)).reshape(-1, 3), polygon_of_triangles(sizes)
    if n_short := np.count_nonzero(sizes < 3):
        n_faces = counted(int(n_short), "face")
        warn_of(path, f"left out {n_faces} with fewer than three corners")
    if len(positions) == 0:
        positions = np.zeros((1, 3))
    known = np.clip(vertices, 0, len(positions) - 1).astype(np.int32)
    triangles, polygons, is_crossed = cut_polygons(positions, known, sizes)
    if n_crossed := np.count_nonzero(is_crossed):
        crossed = counted(int(n_crossed), "face crosses itself", "faces cross themselves")
        warn_of(path, f"{crossed}; the triangles overlap or fold there")
    return triangles, polygons


def cut_polygons(
    positions: FloatArray, vertices: IntArray, sizes: Int64Array
) -> tuple[Int64Array, Int64Array, BoolArray]:
    """Cut polygons into triangles, as `triangulated`, and say which cross themselves."""
    polygons = polygon_of_triangles(sizes)
    triangles = np.empty((len(polygons), 3), np.int64)
    is_crossed = np.zeros(len(sizes), np.bool_)
    first_corners, n_triangles = np.cumsum(sizes) - sizes, np.maximum(sizes - 2, 0)
    first_triangles = np.cumsum(n_triangles) - n_triangles
    run_bands(
        lambda start, stop: core.triangulate_polygons(
            positions, vertices, first_corners, sizes, first_triangles, triangles, is_crossed,
            start, stop,
        ),
        len(sizes),
        band=_BAND,
    )  # fmt: skip
    return triangles, polygons, is_crossed


@dataclass(frozen=True, eq=False)
class Outlines:
    """The polygons of a mesh by their corners."""

    sizes: Int64Array  # (P,) int64; corners of each polygon
    slots: Int64Array  # (C,) int64; corners, polygon after polygon: 3 f + c is corner c of face f
    firsts: Int64Array  # (P,) int64; first face of each polygon
    n_split: int  # polygons that are given as their triangles instead

    def warn(self, path: PathLike) -> None:
        """Warn if polygons are written as triangles."""
        if self.n_split:
            split = counted(self.n_split, "polygon is", "polygons are")
            warn_of(
                path, f"{split} written as triangles, because of a seam or missing faces inside"
            )


def outlines(mesh: Mesh) -> Outlines:
    """Return the polygons of a mesh as outlines; as triangles those without a single outline."""
    polygons, n_split = mesh.polygon_of, 0
    if polygons is None:
        slots = np.arange(3 * mesh.n_faces)
        return Outlines(np.full(mesh.n_faces, 3), slots, np.arange(mesh.n_faces), 0)
    is_large = np.bincount(polygons)[polygons] > 1
    corners = np.flatnonzero(np.repeat(is_large, 3))
    n_left, bad = _outer_edges(mesh, polygons[corners // 3], corners)
    if len(bad):
        is_first = (np.diff(polygons, prepend=-1) > 0) | np.isin(polygons, bad)
        polygons, n_split = (np.cumsum(is_first) - 1).astype(np.int32), len(bad)
    sizes = np.bincount(polygons) + 2
    ends = np.cumsum(sizes)
    slots = np.empty(ends[-1], np.int64)
    is_triangle = np.repeat(sizes[polygons] == 3, 3)
    places = (ends[polygons] - 3)[:, None] + np.arange(3)
    slots[places.ravel()[is_triangle]] = np.flatnonzero(is_triangle)
    kept = ~is_triangle[corners] & (n_left > 0)
    slots[ends[polygons[corners[kept] // 3]] - n_left[kept]] = corners[kept]
    return Outlines(sizes, slots, np.searchsorted(polygons, np.arange(len(sizes))), n_split)


def _outer_edges(
    mesh: Mesh, polygons: IntArray, corners: Int64Array
) -> tuple[Int64Array, Int64Array]:
    """Edges left on the outline (n,), 0 inside, and polygons (m,) without one outline."""
    n = len(corners)
    vertices = mesh.faces.ravel()[corners]
    points = weld_rows(np.stack([polygons, vertices], axis=1))
    ends = points.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    edges = np.stack([points, ends], axis=1)
    is_outer = weld_rows(np.concatenate([edges, edges[:, ::-1]]).astype(np.int32))[n:] >= n
    leaving = np.full(n + 1, n)  # edge that leaves a point
    leaving[points[is_outer]] = np.flatnonzero(is_outer)
    starts = np.flatnonzero(np.diff(polygons, prepend=-1))
    lengths = np.diff(starts, append=n)
    first_edges = leaving[points[starts]]
    followers = leaving[ends]
    followers[followers == np.repeat(first_edges, lengths)] = n
    followers, n_left = np.append(followers, n), np.append(is_outer.astype(np.int64), 0)
    sizes = lengths // 3 + 2
    for _ in range(int(sizes.max()).bit_length()):  # twice as many edges ahead each time
        n_left += n_left[followers]
        followers = followers[followers]
    is_bad = _differs(mesh, corners, leaving[points], np.repeat(starts, lengths))
    is_bad = np.bitwise_or.reduceat(is_bad, starts) | (n_left[first_edges] != sizes)
    is_bad |= np.add.reduceat(is_outer, starts, dtype=np.int64) != sizes
    return np.where(is_outer, n_left[:n], 0), polygons[starts[is_bad]]


def _differs(
    mesh: Mesh, corners: Int64Array, at_point: Int64Array, firsts: Int64Array
) -> BoolArray:
    """(n,) whether a corner has other values than the one of the outline at its vertex.

    `at_point` and `firsts` are the numbers of that corner, n for none, and of the first one of the
    polygon, whose group counts.
    """
    is_other: BoolArray = at_point == len(corners)
    others = corners[np.where(is_other, 0, at_point)]
    pairs = [(item.uvs, item.faces) for item in mesh.uv_sets.values()]
    if mesh.uvs is not None and mesh.uv_faces is not None:
        pairs.append((mesh.uvs, mesh.uv_faces))
    if mesh.normals is not None and mesh.normal_faces is not None:
        pairs.append((mesh.normals, mesh.normal_faces))
    for values, ids in pairs:
        ones, twos = ids.ravel()[corners], ids.ravel()[others]
        differ = np.flatnonzero(ones != twos)
        is_other[differ] |= (values[ones[differ]] != values[twos[differ]]).any(axis=1)
    if mesh.face_groups is not None:
        groups = mesh.face_groups[corners // 3]
        is_other |= groups != groups[firsts]
    return is_other
