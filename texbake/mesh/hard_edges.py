"""Normals that are hard at some edges of a mesh and smooth at all others.

Edges are compared by where they lie, not by their indices. Across a hard edge normals jump; around
each vertex, corners between hard edges share a normal, weighted by angle. Edges at the boundary, of
more than two faces, or of two faces that are wound in opposite ways join nothing. Within one
polygon, a normal is that of the polygon.

Files without normals say which edges are hard by smoothing groups, or by marking edges. One normal
for each face, as scans and many exporters write them, says nothing of hard edges.

Edges at which faces meet at a large angle are sharp if they form long lines on a surface that is
mostly flat or gently curved elsewhere. In 23 meshes, 0.94 to 1.00 of the ends of such edges meet
another one on hard-surface models, and 0.65 to 0.87 on others.

Kernel: `core/union_find.c`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.normals import (
    NORMAL_ROUNDING,
    angles_between,
    face_normals,
    smooth_normals,
    weighted_normals,
)
from texbake.mesh.objects import weld_vertices
from texbake.mesh.options import DEFAULT_ANGLE, NORMALS
from texbake.mesh.polygons import next_corners
from texbake.mesh.topology import (
    edge_keys,
    edge_neighbors,
    next_half_edges,
    opposite_half_edges,
    runs_of_keys,
)
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

SHARP_ANGLE = 40.0  # in degrees; edges at which faces meet at more than this may be sharp

# Cosines of this angle, and of that which gentle curves stay below; the share of ends of sharp
# edges that must run on, and of other edges that may turn more.
_SHARP, _GENTLE = pm.cos(math.radians(SHARP_ANGLE)), pm.cos(math.radians(20.0))
_RUNNING_ON, _MOST_CURVED = 0.9, 0.2

# In degrees; more than rounding to float32 changes the angle between faces that are not slivers.
_ANGLE_ROUNDING = 1e-3


def with_normals(mesh: MeshLike, normals: str = "angle", *, angle: float = DEFAULT_ANGLE) -> Mesh:
    """Return a mesh with other normals; above `angle` degrees between faces an edge is hard."""
    mesh = as_mesh(mesh)
    if normals not in NORMALS:
        raise OptionError(f"normals: {normals} is not one of {', '.join(NORMALS)}")
    if normals == "keep":
        return mesh
    if normals == "smooth":
        return mesh.replace(normals=smooth_normals(mesh), normal_faces=mesh.faces, tangents=None)
    one, other = inner_edges(mesh)
    if normals == "angle":
        sides = face_normals(mesh)
        is_hard = exceed_angle(sides[one // 3], sides[other // 3], angle)
    else:
        ids = weld_rows(mesh.corner_uvs().reshape(-1, 2))
        is_hard = ids[one] != ids[next_half_edges(other)]
        is_hard |= ids[next_half_edges(one)] != ids[other]
    return hardened(mesh, one, other, is_hard)


def exceed_angle(one: FloatArray, other: FloatArray, angle: float) -> BoolArray:
    """(E,) bool: pairs of face normals (E, 3) that differ by more than an angle in degrees."""
    return np.asarray(angles_between(one, other) > math.radians(angle + _ANGLE_ROUNDING))


def with_sharp_edges(mesh: Mesh, *, threads: int | None = None) -> Mesh:
    """Return a mesh with normals that are hard at its sharp edges; itself where it has none."""
    if mesh.normals is not None and not is_flat_shaded(mesh, threads=threads):
        return mesh
    one, other = inner_edges(mesh)
    sides = face_normals(mesh, threads=threads)
    has_area = (sides != 0.0).any(axis=1)
    cosines = pm.vecdot(sides[one // 3], sides[other // 3])
    cosines[~(has_area[one // 3] & has_area[other // 3])] = 1.0
    is_sharp = cosines < _SHARP
    n_sharp = int(np.count_nonzero(is_sharp))
    n_curved = int(np.count_nonzero(cosines < _GENTLE)) - n_sharp
    if n_sharp == 0 or n_curved > _MOST_CURVED * (len(one) - n_sharp):
        return mesh
    places = weld_vertices(mesh)[mesh.faces].ravel()
    ends = places[np.stack([one[is_sharp], next_half_edges(one[is_sharp])])]
    runs_on = np.bincount(ends.ravel())[ends] > 1
    if np.count_nonzero(runs_on) < _RUNNING_ON * runs_on.size:
        return mesh
    return hardened(mesh, one, other, is_sharp)


def with_own_hard_edges(mesh: Mesh) -> Mesh:
    """Return a mesh with new normals that are hard where its own jump; without any, itself."""
    if mesh.normals is None:
        return mesh
    one, other = inner_edges(mesh)
    return hardened(mesh, one, other, normals_jump(mesh, one, other))


@dataclass(frozen=True)
class LowNormals:
    """How a low-poly mesh gets its normals: a choice of `with_normals`, or `auto`."""

    choice: str
    angle: float

    def of_high(self, high: Mesh, *, threads: int | None = None) -> Mesh:
        """Return the high-poly mesh as it is shaded and baked."""
        if self.choice != "keep" and high.normals is None:
            return with_sharp_edges(high, threads=threads)
        return high

    def to_simplify(self, mesh: Mesh, high: Mesh, *, threads: int | None = None) -> Mesh:
        """Return `high`, or a surface around it, with hard edges for the low-poly mesh to keep."""
        if self.choice == "keep" or (mesh is high and high.normals is None):
            return mesh
        return with_sharp_edges(mesh, threads=threads)

    def before_unwrap(self, low: Mesh) -> Mesh:
        """Return the low-poly mesh with hard edges where its charts are to be cut."""
        if self.choice == "auto":
            return with_own_hard_edges(low)
        if self.choice == "uv":
            return low.replace(normals=None, normal_faces=None)
        return with_normals(low, self.choice, angle=self.angle)

    def after_unwrap(self, low: Mesh) -> Mesh:
        """Return the low-poly mesh with the normals that it is shaded and baked with."""
        return with_normals(low, "uv") if self.choice == "uv" else low


def inner_edges(mesh: Mesh, regions: IntArray | None = None) -> tuple[IndexArray, IndexArray]:
    """(E,) both half-edges of each edge across which a surface, or a region of it, continues."""
    places = weld_vertices(mesh)[mesh.faces]
    everywhere = np.ones(mesh.n_faces, dtype=np.bool_)
    opposite = opposite_half_edges(
        places, solid=everywhere, regions=regions, polygons=mesh.polygon_of
    )
    one = np.flatnonzero(opposite > np.arange(len(opposite)))
    return one, opposite[one].astype(np.intp)


def hardened(mesh: Mesh, one: IndexArray, other: IndexArray, is_hard: BoolArray) -> Mesh:
    """Return a mesh with normals hard at some `inner_edges`, but not inside polygons."""
    if mesh.polygon_of is not None:
        is_hard = is_hard & (mesh.polygon_of[one // 3] != mesh.polygon_of[other // 3])
    one, other = one[~is_hard], other[~is_hard]
    # A half-edge starts where the opposite one ends: at the corner after that one's.
    joined = (
        np.concatenate([one, next_half_edges(one)]),
        np.concatenate([next_half_edges(other), other]),
    )
    slots = np.arange(mesh.faces.size).reshape(-1, 3)
    numbers = np.repeat(mesh.polygon_numbers, 3)
    normals = joined_normals(mesh.positions, mesh.faces, slots, *joined, numbers)
    return mesh.replace(**normals, tangents=None)


def has_hard_edges(mesh: Mesh, *, threads: int | None = None) -> bool:
    """Whether a mesh has edges that its own normals make hard, other than those of facets."""
    if mesh.normals is None or is_flat_shaded(mesh, threads=threads):
        return False
    return bool(normals_jump(mesh, *inner_edges(mesh)).any())


def normals_jump(mesh: Mesh, one: IndexArray, other: IndexArray) -> BoolArray:
    """(E,) bool: edges whose faces have normals more than a degree apart at either end."""
    assert mesh.normals is not None
    assert mesh.normal_faces is not None
    ids = mesh.normal_faces.ravel()
    jumps = np.zeros(len(one), dtype=np.bool_)
    for here, there in ((one, next_half_edges(other)), (next_half_edges(one), other)):
        a, b = ids[here], ids[there]
        differ = np.flatnonzero(a != b)
        angles = angles_between(mesh.normals[a[differ]], mesh.normals[b[differ]])
        jumps[differ] |= angles > NORMAL_ROUNDING
    return jumps


# Neighboring facets at a smaller angle, whose cosine this is, are too fine to be meant as flat.
_FINE = pm.cos(np.radians(5.0))


@dataclass(frozen=True, eq=False)
class EdgePairs:
    """Edges of two polygons."""

    # one, other: (E,) int64; corners at which the two polygons start the edge.
    one: Int64Array
    other: Int64Array
    # (C,) int64; number of the edge that starts at each corner, the same in all its polygons.
    keys: Int64Array
    n_more: int  # edges of more than two polygons


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons by their corners."""

    vertices: Int64Array  # (C,) int64; vertex of each corner
    sizes: Int64Array  # (P,) int64; corners of each polygon, in the order of `vertices`

    @classmethod
    def of(cls, vertices: AnyArray, sizes: AnyArray) -> Polygons:
        """Return polygons by integers of any type."""
        return cls(vertices.astype(np.int64), sizes.astype(np.int64))

    def pairs(self, slots: Int64Array) -> EdgePairs:
        """Find the edges of two polygons, of those whose corners `slots` are in triangles."""
        heads = self.vertices[next_corners(self.sizes)]
        keys = edge_keys(self.vertices, heads)
        in_triangle = np.zeros(len(self.vertices), np.bool_)
        in_triangle[slots] = True  # left out are holes, and corners that are no vertices
        corners = np.flatnonzero(in_triangle & (self.vertices != heads))
        order, starts, counts = runs_of_keys(keys[corners])
        one, other = (corners[order[starts[counts == 2] + side]] for side in (0, 1))
        return EdgePairs(one, other, keys, int(np.count_nonzero(counts > 2)))


def smoothed_normals(
    positions: FloatArray,
    faces: IntArray,
    polygons: Polygons,
    slots: Int64Array,
    pairs: EdgePairs,
    is_smooth: BoolArray,
) -> dict[str, Any]:
    """Return normals as fields of a mesh, smooth across pairs (E,); none where no edge is hard."""
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
    mesh: Mesh, polygons: Polygons, slots: Int64Array | None, groups: IntArray
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


def _has_fine_facets(mesh: Mesh, slots: Int64Array, pairs: EdgePairs) -> bool:
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
    """Return normals as fields of a mesh, each shared by the corners that pairs join."""
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
    """Whether a curved surface has a single normal on each of its facets."""
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


def turn_gently(one: FloatArray, other: FloatArray, turns: BoolArray, cosine: float) -> bool:
    """Whether at least half of the pairs of normals turn, by less than an angle in the median."""
    if 2 * np.count_nonzero(turns) < len(turns) or not len(turns):
        return False
    return bool(np.median(pm.vecdot(one[turns], other[turns])) > cosine)


def _differ(normals: FloatArray, one: IntArray, other: IntArray) -> BoolArray:
    """(n,) bool: pairs of normals, by their rows, that differ by more than rounding."""
    differs: BoolArray = one != other
    apart = np.abs(normals[one[differs]] - normals[other[differs]]).max(axis=1, initial=0.0)
    differs[differs] = apart > _ROUNDING
    return differs
