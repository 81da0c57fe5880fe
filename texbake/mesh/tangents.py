"""MikkTSpace: the tangents that renderers and bakers have agreed on.

Based on: Morten S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", master's thesis,
University of Copenhagen, 2008, and the rules published with its reference implementation:

1. Corners of equal position, normal and texture coordinates are one vertex.
2. Around a vertex, triangles form fans that grow across shared edges and stop where the mapping
   changes from mirrored to not mirrored. Each fan has one tangent.
3. The tangent is the sum of the directions in which u grows in each triangle, each projected into
   the plane of the vertex normal, normalized, and weighted with the projected angle of the
   triangle's corner.
4. A triangle without area in texture space adds nothing and joins the first fan that reaches it.
5. A triangle with two equal positions takes no part; its corners copy those of the first triangle
   that uses the same vertex.
6. A quadrilateral is cut along the diagonal that is shorter in the texture, or in space if both are
   equally long there, else from the first corner, however the mesh cuts it. If its halves are
   mapped in opposite ways, the larger one decides for both; the second, if it has no area. Corners
   of a half with two equal positions take the tangents of the other half. Polygons of more corners
   count as their triangles.

In step 3, opposite directions can cancel up to rounding, and the remainder is then part of the
definition. These steps therefore use float32, and the order of operations and the arc cosine of
Blender's port (intern/mikktspace, Copyright Blender Authors), against which the tests check this
module. Sums are in float64, so that they hardly depend on the order of faces. As in that port,
there is no angular threshold.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    Float32Array,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.normals import shading_normals
from texbake.mesh.polygons import outlines
from texbake.mesh.topology import edge_keys
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

# Corners of the halves, cut between the corners 0 and 2, or 1 and 3; and the places of their common
# corners in the first half and in the second.
_HALVES = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
_COMMON = np.array([[[0, 2], [0, 1]], [[1, 2], [0, 2]]])


@dataclass(frozen=True, eq=False)
class Quads:
    """The triangles that the reference makes of a mesh with quadrilaterals."""

    # (F, 3) int64; corners of the mesh, 3 f + c, that are the corners of each triangle.
    slots: Int64Array
    firsts: Int64Array  # (Q,) int64; first triangle of each quadrilateral; the next is the second
    # (3 F,) int64; corner of the triangles that each corner of the mesh takes its tangent from.
    sources: Int64Array
    # (2, Q, 2) int64; corners of the triangles at the ends of the diagonal, in the first and in the
    # second.
    common: Int64Array

    @classmethod
    def of(cls, mesh: Mesh, points: FloatArray, uvs: AnyArray) -> Quads | None:
        """Find quadrilaterals by corners' `points` (F, 3, 3) and `uvs` (F, 3, 2); None if none."""
        if mesh.polygon_of is None:
            return None
        polygons = outlines(mesh)
        chosen = np.flatnonzero(polygons.sizes == 4)
        firsts = polygons.firsts[chosen]
        ends = np.cumsum(polygons.sizes)[chosen]
        corners = polygons.slots[(ends - 4)[:, None] + np.arange(4)]
        is_other = _is_shorter(uvs.reshape(-1, 2)[corners])
        is_equal = ~is_other & ~_is_shorter(uvs.reshape(-1, 2)[corners[:, [1, 2, 3, 0]]])
        is_other |= is_equal & _is_shorter(points.reshape(-1, 3)[corners])
        halves = _HALVES[is_other.astype(np.intp)]
        slots = np.arange(3 * mesh.n_faces).reshape(-1, 3)
        slots[firsts[:, None] + np.arange(2)] = corners[
            np.arange(len(corners))[:, None, None], halves
        ]
        starts = 3 * (firsts[:, None] + np.arange(2))
        common = starts.T[:, :, None] + _COMMON[is_other.astype(np.intp)].transpose(1, 0, 2)
        sources = np.arange(3 * mesh.n_faces)
        mine = 3 * firsts[:, None] + np.arange(6)
        vertices = mesh.faces.ravel()
        is_there = vertices[mine][:, :, None] == vertices[slots.ravel()[mine]][:, None, :]
        sources[mine] = np.take_along_axis(mine, is_there.argmax(axis=2), axis=1)
        return cls(slots, firsts, sources, common)

    def cut(self, *by_corner: AnyArray) -> tuple[AnyArray, ...]:
        """Arrays (F, 3, ...) by corners of the mesh, as those by corners of the triangles."""
        return tuple(array.reshape(-1, *array.shape[2:])[self.slots] for array in by_corner)

    def joined(
        self, points: FloatArray, tangents: FloatArray, preserving: BoolArray, has_fan: BoolArray
    ) -> tuple[FloatArray, BoolArray, BoolArray]:
        """Tangents, orientations and whether there is a fan, by corners of the mesh."""
        collapsed = (points == points[:, [1, 2, 0]]).all(axis=2).any(axis=1)
        is_odd = collapsed[self.firsts] != collapsed[self.firsts + 1]
        good = self.firsts[is_odd] + collapsed[self.firsts[is_odd]]
        bad = 2 * self.firsts[is_odd] + 1 - good
        there = (points[bad][:, :, None] == points[good][:, None]).all(axis=3).argmax(axis=2)
        for values in (tangents, preserving, has_fan):
            values[bad] = values[good[:, None], there]
        tangents, preserving = tangents.reshape(-1, 3), preserving.ravel()
        has_fan = has_fan.ravel()
        one, other = self.common.reshape(2, -1)
        sums = tangents[one] * has_fan[one, None] + tangents[other] * has_fan[other, None]
        lengths = np.sqrt((sums * sums).sum(axis=1, keepdims=True))
        means = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
        is_same = (tangents[one] == tangents[other]).all(axis=1, keepdims=True)
        tangents[one] = tangents[other] = np.where(is_same, tangents[one], means)
        preserving[one] = preserving[other] = np.where(
            has_fan[other], preserving[other], preserving[one]
        )
        has_fan[one] |= has_fan[other]
        has_fan[other] |= has_fan[one]
        sources = self.sources.reshape(-1, 3)
        return tangents[sources], preserving[sources], has_fan[sources]


def _is_shorter(corners: AnyArray) -> BoolArray:
    """Whether corners 1 and 3 of (Q, 4, K) are closer together than 0 and 2, in float32."""
    first, second = ((corners[:, i + 2] - corners[:, i]).astype(np.float32) for i in (0, 1))
    return np.asarray(_squares(second) < _squares(first))


def _squares(vectors: AnyArray) -> AnyArray:
    products = vectors * vectors
    total = products[:, 0] + products[:, 1]
    return np.asarray(total + products[:, 2] if vectors.shape[1] > 2 else total)


def agree(
    quads: Quads, solid: IndexArray, uvs: AnyArray, unmapped: BoolArray, preserving: BoolArray
) -> None:
    """Give both halves of a quadrilateral one orientation, in place, in arrays of `solid` (n,)."""
    at = np.searchsorted(solid, quads.firsts)
    at = at[at < len(solid) - 1]
    is_first = np.isin(solid[at], quads.firsts) & (solid[at + 1] == solid[at] + 1)
    one = at[is_first]
    other = one + 1
    edges = uvs[:, 1:] - uvs[:, :1]
    areas = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    is_chosen = unmapped[other] | (areas[one] >= areas[other])
    preserving[one] = preserving[other] = np.where(is_chosen, preserving[one], preserving[other])


# Cosine of the angle between the x axis and a normal from which on (0.08 degrees) they count as
# parallel: the default tangent of a corner must span a plane with its normal, in float32.
_PARALLEL = 1.0 - 1e-6


def image_axes(linear: npt.NDArray[np.floating[Any]]) -> Float32Array:
    """(2, 2) axes of a normal map, by rows, whose coordinates the (2, 2) `linear` map transforms.

    >>> image_axes(np.array([[0.0, -2.0], [2.0, 0.0]])).tolist()
    [[0.0, -1.0], [1.0, -0.0]]
    """
    linear = linear * unit_scale(float(np.abs(linear).max()))  # no product is beyond float64
    if pm.det(linear) == 0.0:
        return np.eye(2, dtype=np.float32)
    axes = pm.inv(linear).T
    axes = axes * [[unit_scale(float(size))] for size in np.abs(axes).max(axis=1)]
    if not axes.any(axis=1).all():
        return np.eye(2, dtype=np.float32)
    return np.asarray(axes / pm.norm(axes, axis=1, keepdims=True), np.float32)


def corner_tangents(mesh: MeshLike) -> Float32Array:
    """(F, 3, 4) MikkTSpace tangents of corners, for the mesh's texture coordinates and normals.

    Interpolate tangents, normals and bitangents over a face without renormalizing them; the
    bitangent of a corner is ``w * cross(normal, tangent)``. The normals are the mesh's own, as
    they are, else `smooth_normals`. Tangents that came with the file (`Mesh.tangents`) are
    ignored. Scaling by a power of two changes no bit.
    """
    mesh = as_mesh(mesh)
    corner_uvs = mesh.corner_uvs()
    uvs = (corner_uvs * unit_scale(float(np.abs(corner_uvs).max()))).astype(np.float32)
    shading, shading_faces = shading_normals(mesh)
    normals, normal_faces = shading, shading_faces
    if mesh.normals is not None and mesh.normal_faces is not None:
        # Zero vectors among them stay: to the reference they mean no projection.
        normals, normal_faces = mesh.normals, mesh.normal_faces
    corner_normals = normals[normal_faces].astype(np.float32)
    points = mesh.positions[mesh.faces] * LocalFrame.around(mesh).scale
    columns = (weld_rows(v.reshape(-1, v.shape[2])) for v in (points, corner_normals, uvs))
    vertices = weld_rows(np.stack(list(columns), axis=1)).reshape(-1, 3)
    quads = Quads.of(mesh, points, uvs)
    if quads is None:
        tangents, preserving, has_fan = _corner_spaces(points, corner_normals, uvs, vertices)
    else:
        points, corner_normals, uvs, vertices = quads.cut(points, corner_normals, uvs, vertices)
        spaces = _corner_spaces(points, corner_normals, uvs, vertices, quads)
        tangents, preserving, has_fan = quads.joined(points, *spaces)
    signs = np.where(preserving, 1.0, -1.0)
    _fill_missing(tangents, signs, has_fan, shading[shading_faces])
    return np.concatenate([tangents, signs[..., None]], axis=2, dtype=np.float32)


def shading_tangents(mesh: Mesh) -> Float32Array:
    """(F, 3, 4) float32 corner tangents: those of the file, else those of MikkTSpace."""
    return corner_tangents(mesh) if mesh.tangents is None else mesh.tangents


def _fill_missing(
    tangents: FloatArray, signs: FloatArray, has_fan: BoolArray, normals: FloatArray
) -> None:
    """Give corners without a tangent, in place, what `corner_tangents` promises them."""
    missing = ~tangents.any(axis=2)
    if not missing.any():
        return
    around = normals[missing]
    without_fan = ~has_fan[missing]
    along_x = np.abs(around[:, 0]) > _PARALLEL
    signs[missing] = np.where(without_fan & along_x, 1.0, signs[missing])
    across = np.cross(np.eye(3)[np.abs(around).argmin(axis=1)], around)
    lengths = pm.norm(across, axis=1, keepdims=True)  # 0 for a zero normal
    is_x = (without_fan & ~along_x)[:, None] | (lengths == 0.0)
    tangents[missing] = np.where(is_x, [1.0, 0.0, 0.0], across / np.where(is_x, 1.0, lengths))


# What the reference takes for zero: the least normal float32, compared with areas and squared
# lengths of things that are at most about 1.
_ZERO = np.finfo(np.float32).tiny

# Below the last bit of the sum of a fan in which any angle is more than rounding.
_LEAST_ANGLE = np.float32(2.0**-70)

_NEXT, _PREVIOUS = [1, 2, 0], [2, 0, 1]


def _corner_spaces(
    points: FloatArray,
    normals: Float32Array,
    uvs: Float32Array,
    vertices: IntArray,
    quads: Quads | None = None,
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Tangent, orientation and kind of every corner.

    `points` (F, 3, 3) float64: corner positions, in a frame where the mesh has about unit size;
    `normals` (F, 3, 3) float32: corner normals, unit; `uvs` (F, 3, 2) float32; `vertices` (F, 3)
    int32. Returns `tangents` (F, 3, 3) float64: unit, or 0 where the directions of a fan cancel
    exactly, and for a corner without fan; `preserving` (F, 3) bool: whether the mapping keeps the
    orientation (False: mirrored); False without fan; `has_fan` (F, 3) bool: false where no rule
    gives a tangent.
    """
    collapsed = (points == points[:, _NEXT]).all(axis=2).any(axis=1)
    solid = np.flatnonzero(~collapsed)
    tangents = np.zeros((len(points), 3, 3))
    preserving = np.zeros((len(points), 3), dtype=bool)
    has_fan = np.zeros((len(points), 3), dtype=bool)

    solid_vertices = vertices[solid]
    edges = (points[solid][:, _NEXT] - points[solid]).astype(np.float32)
    directions, unmapped, mapped_preserving = _directions_of_u(edges, uvs[solid])
    if quads is not None:
        agree(quads, solid, uvs[solid], unmapped, mapped_preserving)
    fans, fan_preserving = _fans(solid_vertices, unmapped, mapped_preserving)
    weighted = _weighted_directions(edges, normals[solid], directions)
    in_fan = fans >= 0
    adding = in_fan & ~unmapped[:, None]
    sums = np.empty((len(fan_preserving), 3))
    for axis in range(3):
        sums[:, axis] = np.bincount(fans[adding], weighted[adding, axis], len(fan_preserving))
    fan_tangents = _unit(sums)

    has_fan[solid] = in_fan
    tangents[has_fan] = fan_tangents[fans[in_fan]]
    preserving[has_fan] = fan_preserving[fans[in_fan]]
    _copy_to_collapsed(vertices, solid, np.flatnonzero(collapsed), tangents, preserving, has_fan)
    return tangents, preserving, has_fan


def _directions_of_u(
    edges: Float32Array, uvs: Float32Array
) -> tuple[AnyArray, BoolArray, BoolArray]:
    """Unit direction in which u grows, whether there is none, and whether v then grows leftward."""
    to_second, to_third = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area = to_second[:, 0] * to_third[:, 1] - to_second[:, 1] * to_third[:, 0]
    edge_second, edge_third = edges[:, 0], -edges[:, 2]
    along_u = to_third[:, 1:] * edge_second - to_second[:, 1:] * edge_third
    along_v = -to_third[:, :1] * edge_second + to_second[:, :1] * edge_third
    preserving = area > 0.0
    square_u, square_v = _dot(along_u, along_u), _dot(along_v, along_v)
    unmapped = ~((np.abs(area) > _ZERO) & (square_u > _ZERO) & (square_v > _ZERO))
    signs = np.where(preserving, np.float32(1), np.float32(-1))
    lengths = np.sqrt(np.where(unmapped, np.float32(1), square_u))
    return along_u * (signs / lengths)[:, None], unmapped, preserving


def _weighted_directions(
    edges: Float32Array, normals: Float32Array, directions: AnyArray
) -> AnyArray:
    """(F, 3, 3): each face's direction in the plane of a corner's normal, times its angle there."""
    leaving = _unit(_flattened(edges, normals))
    arriving = _unit(_flattened(-edges[:, _PREVIOUS], normals))
    # A needle whose angle rounds to 0 still has a direction, which counts where no other does.
    angles = np.maximum(_arc_cosines(_dot(leaving, arriving)), _LEAST_ANGLE)
    return _unit(_flattened(directions[:, None, :], normals)) * angles[..., None]


def _arc_cosines(cosines: AnyArray) -> AnyArray:
    """Arc cosine to 4.6e-5 radians: the polynomial of Blender's port."""
    size = np.minimum(np.abs(cosines), np.float32(1))
    series = size * np.float32(-0.02164095) + np.float32(0.077980478)
    series = size * series + np.float32(-0.213300989)
    series = size * series + np.float32(1.5707963267)
    angles = np.sqrt(np.float32(1) - size) * series
    return np.asarray(np.where(cosines < 0.0, np.float32(np.pi) - angles, angles))


def _copy_to_collapsed(
    vertices: IntArray, solid: IndexArray, collapsed: IndexArray, *per_corner: AnyArray
) -> None:
    """Give corners of collapsed faces, in place, what the first solid corner of the vertex has."""
    if len(collapsed) == 0:
        return
    donors = np.full(vertices.max() + 1, -1)
    corners = np.arange(vertices.size).reshape(-1, 3)
    # Of several values for one place the last stays, so that reversed the first one does.
    donors[vertices[solid].ravel()[::-1]] = corners[solid].ravel()[::-1]
    takers = corners[collapsed].ravel()
    sources = donors[vertices[collapsed].ravel()]
    takers, sources = takers[sources >= 0], sources[sources >= 0]
    for values in per_corner:
        by_corner = values.reshape(vertices.size, -1)
        by_corner[takers] = by_corner[sources]


def _dot(a: AnyArray, b: AnyArray) -> AnyArray:
    """Dot products over the last axis; the order of additions is the reference's."""
    products = a * b
    return np.asarray(products[..., 0] + products[..., 1] + products[..., 2])


def _unit(vectors: AnyArray) -> AnyArray:
    """Unit vectors; a zero vector stays zero."""
    lengths = np.sqrt(_dot(vectors, vectors))
    lengths[lengths == 0.0] = 1.0
    return np.asarray(vectors * (1 / lengths)[..., None])


def _flattened(vectors: AnyArray, normals: AnyArray) -> AnyArray:
    """Vectors projected into the plane of each normal."""
    return np.asarray(vectors - normals * _dot(normals, vectors)[..., None])


def _fans(
    vertices: IntArray, unmapped: BoolArray, preserving: BoolArray
) -> tuple[IntArray, BoolArray]:
    """(F, 3) fan of corners or -1, and whether it keeps orientation; `core/mikktspace_fans.c`."""
    fans = np.full(vertices.shape, -1, dtype=np.int32)
    fan_preserving = np.zeros(vertices.size, dtype=bool)
    neighbors = _neighbors(vertices)
    n_fans = core.number_fans(vertices, neighbors, unmapped, preserving, fans, fan_preserving)
    return fans, fan_preserving[:n_fans]


def _neighbors(vertices: IntArray) -> IntArray:
    """(F, 3) face across the edge from each corner to the next, if wound alike; -1 for none."""
    keys = edge_keys(vertices, vertices[:, _NEXT]).ravel()
    edges = np.argsort(keys, kind="stable")
    neighbors = np.full(vertices.size, -1, dtype=np.int32)
    core.pair_edges(keys, edges, vertices.ravel(), neighbors)
    return neighbors.reshape(-1, 3)
