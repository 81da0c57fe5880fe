"""Normals of files without them, from smoothing groups of polygons or from smooth and hard edges.

An edge is hard where the format says so, and where more than two polygons meet. Around each vertex,
corners between hard edges share a normal, weighted by angle; within one polygon, it is that of the
polygon.

Scans, marching cubes and many exporters write one normal for each face. Such normals say nothing of
where an edge is hard: read as hard edges, every edge of a curved surface would be one.

Kernel: `core/union_find.c`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals, weighted_normals
from texbake.mesh.objects import weld_vertices
from texbake.mesh.polygons import next_corners
from texbake.mesh.topology import edge_neighbors
from texbake.mesh.weld import weld_rows

Indices = npt.NDArray[np.int64]

# Neighboring facets at a smaller angle, whose cosine this is, are too fine to be meant as flat.
_FINE = pm.cos(np.radians(5.0))


@dataclass(frozen=True, eq=False)
class EdgePairs:
    """Edges of two polygons."""

    # one, other: (E,) int64; corners at which the two polygons start the edge.
    one: Indices
    other: Indices
    # (C,) int64; number of the edge that starts at each corner, the same in all its polygons.
    keys: Indices
    n_more: int  # edges of more than two polygons


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons by their corners."""

    vertices: Indices  # (C,) int64; vertex of each corner
    sizes: Indices  # (P,) int64; corners of each polygon, in the order of `vertices`

    @classmethod
    def of(cls, vertices: npt.NDArray[Any], sizes: npt.NDArray[Any]) -> Polygons:
        """Return polygons by integers of any type."""
        return cls(vertices.astype(np.int64), sizes.astype(np.int64))

    def pairs(self, slots: Indices) -> EdgePairs:
        """Find the edges of two polygons, of those whose corners `slots` are in triangles."""
        following = next_corners(self.sizes)
        keys = self.edge_keys(following)
        in_triangle = np.zeros(len(self.vertices), np.bool_)
        in_triangle[slots] = True  # left out are holes, and corners that are no vertices
        corners = np.flatnonzero(in_triangle & (self.vertices != self.vertices[following]))
        order = corners[np.argsort(keys[corners], kind="stable")]
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        counts = np.diff(np.append(starts, len(order)))
        first = starts[counts == 2]
        n_more = int(np.count_nonzero(counts > 2))
        return EdgePairs(order[first], order[first + 1], keys, n_more)

    def edge_keys(self, following: Indices) -> Indices:
        """(C,) number of the edge that starts at each corner, the same in all its polygons."""
        heads = self.vertices[following]
        return np.minimum(self.vertices, heads) * (1 << 31) + np.maximum(self.vertices, heads)


def smoothed_normals(
    positions: FloatArray,
    faces: IntArray,
    polygons: Polygons,
    slots: Indices,
    pairs: EdgePairs,
    is_smooth: npt.NDArray[np.bool_],
) -> dict[str, Any]:
    """Return normals as fields of a mesh: none where no edge is hard.

    `positions` (V, 3) float64; `faces` (F, 3) int32; `slots` (F, 3) int64: corners of the
    triangles; `is_smooth` (E,) bool: for each of the pairs.
    """
    if is_smooth.all() and pairs.n_more == 0:
        return {}
    following = next_corners(polygons.sizes)
    one, other = pairs.one[is_smooth], pairs.other[is_smooth]
    # Polygons that run along an edge in opposite ways have its ends at opposite corners.
    is_opposite = polygons.vertices[one] != polygons.vertices[other]
    here = np.where(is_opposite, following[other], other)
    there = np.where(is_opposite, other, following[other])
    joined = np.concatenate([one, following[one]]), np.concatenate([here, there])
    polygon_of = np.repeat(np.arange(len(polygons.sizes)), polygons.sizes)
    return joined_normals(positions, faces, slots, *joined, polygon_of)


def with_smoothing_groups(
    mesh: Mesh, polygons: Polygons, slots: Indices | None, groups: IntArray
) -> Mesh:
    """Return a mesh with normals that are hard between groups; the same mesh if it has only one.

    It also stays as it is if no polygon has a group and its facets are fine, as those of a scan
    are: many programs write `s off` for every mesh.

    `slots` (F, 3) int64: corners of the triangles; None where each polygon is one; `groups` (P,)
    int32: 0 for polygons without a group, all of whose edges are hard.
    """
    if slots is None:
        slots = np.arange(len(polygons.vertices)).reshape(-1, 3)
    if groups[0] != 0 and (groups == groups[0]).all():
        return mesh
    pairs = polygons.pairs(slots)
    if not groups.any() and _has_fine_facets(mesh, slots, pairs):
        return mesh
    group_of = np.repeat(groups, polygons.sizes)
    one, other = group_of[pairs.one], group_of[pairs.other]
    is_smooth = (one == other) & (one != 0)
    normals = smoothed_normals(mesh.positions, mesh.faces, polygons, slots, pairs, is_smooth)
    return mesh.replace(**normals)


def _has_fine_facets(mesh: Mesh, slots: Indices, pairs: EdgePairs) -> bool:
    """Whether facets turn at most edges, by less than `_FINE` at half of these."""
    face_of = np.zeros(len(pairs.keys), np.int64)
    face_of[slots.ravel()] = np.arange(slots.size) // 3
    sides = face_normals(mesh)
    one, other = sides[face_of[pairs.one]], sides[face_of[pairs.other]]
    return turn_gently(one, other, (one != other).any(axis=1), _FINE)


def joined_normals(
    positions: FloatArray,
    faces: IntArray,
    slots: npt.NDArray[np.integer],
    one: npt.NDArray[np.integer],
    other: npt.NDArray[np.integer],
    polygon_of: npt.NDArray[np.integer],
) -> dict[str, Any]:
    """Return normals as fields of a mesh, each shared by the corners that pairs join.

    Corners that share theirs with no other polygon have that of their own.

    `positions` (V, 3) float64; `faces` (F, 3) int32; `slots` (F, 3) int; `one`, `other` (n,) int:
    corners at one vertex that share a normal; `polygon_of` (C,) int.
    """
    n = len(polygon_of)
    labels = np.arange(n, dtype=np.int32)
    core.merge_labels(labels, one.astype(np.int32), other.astype(np.int32))
    first, last = np.empty(n, np.int64), np.empty(n, np.int64)
    first[labels[::-1]] = polygon_of[::-1]
    last[labels] = polygon_of
    is_alone = first[labels] == last[labels]
    labels = np.where(is_alone, n + polygon_of, labels)
    used, inverse = np.unique(labels[slots], return_inverse=True)
    rows = np.asarray(inverse.reshape(slots.shape), np.int32)
    return {"normals": weighted_normals(positions, faces, rows, len(used)), "normal_faces": rows}


# Components of float32 unit vectors that are rounded differently differ by less.
_ROUNDING = 1e-6
# A surface is curved where half its facets turn by less than this from one to the next. Edges of
# what is built of flat sides, such as a crate, turn by more.
_CURVED = pm.cos(np.radians(30.0))


def is_flat_shaded(mesh: Mesh, *, threads: int | None = None) -> bool:
    """Whether a curved surface has a single normal on each of its facets.

    A facet is a triangle or a polygon that was cut into triangles. False for a mesh without normals
    and for one whose facets mostly meet at sharp edges.
    """
    if mesh.normals is None or mesh.normal_faces is None:
        return False
    corners = weld_rows(mesh.normals, threads=threads)[mesh.normal_faces]
    firsts = np.repeat(corners[:, :1], 3, axis=1)
    if _differ(mesh.normals, corners.ravel(), firsts.ravel()).any():
        return False
    neighbors = edge_neighbors(weld_vertices(mesh, threads=threads)[mesh.faces])
    a, b = corners[neighbors.first, 0], corners[neighbors.second, 0]
    hard = _differ(mesh.normals, a, b)
    return turn_gently(mesh.normals[a], mesh.normals[b], hard, _CURVED)


def turn_gently(
    one: FloatArray, other: FloatArray, turns: npt.NDArray[np.bool_], cosine: float
) -> bool:
    """Whether at least half of the pairs of normals turn, by less than an angle in the median."""
    if 2 * np.count_nonzero(turns) < len(turns) or not len(turns):
        return False
    return bool(np.median(pm.vecdot(one[turns], other[turns])) > cosine)


def _differ(normals: FloatArray, one: IntArray, other: IntArray) -> npt.NDArray[np.bool_]:
    """(n,) bool: pairs of normals, by their rows, that differ by more than rounding."""
    found: npt.NDArray[np.bool_] = one != other
    apart = np.abs(normals[one[found]] - normals[other[found]]).max(axis=1, initial=0.0)
    found[found] = apart > _ROUNDING
    return found
