"""Quadrilaterals of MikkTSpace, whose tangents do not depend on how a mesh cuts them.

The reference cuts a quadrilateral along the diagonal that is shorter in the texture, or in space if
both are equally long there, else from the first corner. If its halves are mapped in opposite ways,
the larger one decides for both; the second, if it has no area. Corners of a half with two equal
positions take the tangents of the other half. Polygons of more corners count as their triangles.

Based on: Morten S. Mikkelsen, mikktspace.c, 2011, and Blender's port (intern/mikktspace, Copyright
Blender Authors).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, Mesh
from texbake.mesh.polygons import outlines
from texbake.records import dataclass

AnyArray = npt.NDArray[Any]

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
    quads: Quads,
    solid: npt.NDArray[np.intp],
    uvs: AnyArray,
    unmapped: BoolArray,
    preserving: BoolArray,
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
