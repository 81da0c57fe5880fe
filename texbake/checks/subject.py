"""A mesh that is checked, with what several checks ask of it, computed once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.options import CheckOptions
from texbake.mapping.overlap import Overlaps, find_overlaps
from texbake.mapping.seams import connected_faces, edge_ids
from texbake.mesh.frame import unit_scale
from texbake.mesh.kernels.normals import AREA_ROUNDING
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import duplicate_faces, repeated_vertices
from texbake.mesh.weld import weld_rows

BoolArray = npt.NDArray[np.bool_]
Ids = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of the faces of a surface, and who has them.

    Attributes
    ----------
    faces : (n,) int64
        The faces looked at, ascending.
    ids : (n, 3) int64
        Edge from each of their corners to the next.
    counts : (E,) int64
        Faces that have each edge.
    ordered : (3 n,) int64
        Half-edges, 3 i + c for corner c of the i-th of `faces`, by edge and then by number.
    starts : (E,) int64
        Place in `ordered` of the first half-edge of each edge.
    """

    faces: Ids
    ids: Ids
    counts: Ids
    ordered: Ids
    starts: Ids

    @classmethod
    def of(cls, corners: npt.NDArray[np.integer[Any]], faces: Ids) -> Edges:
        """Edges between (F, 3) corners, of some faces."""
        ids = edge_ids(corners[faces])
        counts = np.bincount(ids.ravel())
        ordered = np.argsort(ids.ravel(), kind="stable")
        return cls(faces, ids, counts, ordered, np.cumsum(counts) - counts)

    def pairs(self) -> tuple[Ids, Ids]:
        """Both half-edges of each edge of exactly two faces."""
        firsts = self.starts[self.counts == 2]
        return self.ordered[firsts], self.ordered[firsts + 1]

    def faces_at(self, edges: BoolArray) -> tuple[Ids, Ids]:
        """Faces at some of the edges, given as (E,) bool, and the edge each was found at."""
        rows, corners = np.nonzero(edges[self.ids])
        return self.faces[rows], self.ids[rows, corners]


class Subject:
    """A mesh, which of the two it is, and what is asked of it more than once.

    Parameters
    ----------
    mesh
    role : str
        `light` or `dense`.
    options
    """

    def __init__(self, mesh: Mesh, role: str, options: CheckOptions) -> None:
        self.mesh = mesh
        self.role = role
        self.options = options
        farthest = float(np.abs(mesh.bounds).max())
        # A power of two: lengths and areas can be computed at any size, and no bit is lost.
        self.scale = unit_scale(farthest)

    @cached_property
    def positions(self) -> FloatArray:
        """(V, 3) float64: positions times `scale`, in [-1, 1]."""
        return frozen(self.mesh.positions * self.scale)

    @cached_property
    def corners(self) -> FloatArray:
        """(F, 3, 3) float64: scaled positions of the corners."""
        return self.positions[self.mesh.faces]

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, scaled."""
        low, high = self.mesh.bounds * self.scale
        return float(np.linalg.norm(high - low))

    @cached_property
    def firsts(self) -> IntArray:
        """(V,) int32: first vertex at the place of each."""
        return weld_rows(self.mesh.positions, threads=self.options.threads)

    @cached_property
    def places(self) -> IntArray:
        """(F, 3) int32: equal for corners at one place."""
        return self.firsts[self.mesh.faces]

    @cached_property
    def normals(self) -> FloatArray:
        """(F, 3) float64: unit normals of faces, zero for those without area."""
        return face_normals(self.mesh, threads=self.options.threads)

    @cached_property
    def has_area(self) -> BoolArray:
        """(F,) bool: faces with area in space."""
        return np.asarray((self.normals != 0.0).any(axis=1))

    @cached_property
    def areas(self) -> FloatArray:
        """(F,) float64: scaled areas, 0 where `has_area` is false."""
        a, b, c = (self.corners[:, corner] for corner in range(3))
        crosses = np.cross(b - a, c - a)
        return np.asarray(np.where(self.has_area, np.linalg.norm(crosses, axis=1) / 2.0, 0.0))

    @cached_property
    def duplicates(self) -> BoolArray:
        """(F,) bool: faces at the places of an earlier one; none without three of them."""
        return np.asarray(duplicate_faces(self.places) & ~repeated_vertices(self.places))

    @cached_property
    def edges(self) -> Edges:
        """Edges by place, of faces at three places that repeat no other."""
        kept = ~self.duplicates & ~repeated_vertices(self.places)
        return Edges.of(self.places, np.flatnonzero(kept))

    @property
    def has_coordinates(self) -> bool:
        """Whether the mesh has texture coordinates."""
        return self.mesh.uvs is not None

    @cached_property
    def uvs(self) -> FloatArray:
        """(F, 3, 2) float64: texture coordinates of the corners."""
        return self.mesh.corner_uvs()

    @cached_property
    def uv_ids(self) -> IntArray:
        """(F, 3) int32: equal for corners of equal texture coordinates."""
        assert self.mesh.uvs is not None
        return weld_rows(self.mesh.uvs, threads=self.options.threads)[self.mesh.uv_faces]

    @cached_property
    def uv_areas(self) -> FloatArray:
        """(F,) float64: signed areas in the texture, 0 where they are rounding."""
        a, b, c = (self.uvs[:, corner] for corner in range(3))
        first, second = b - a, c - a
        doubles = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        longest = np.maximum((first**2).sum(axis=1), (second**2).sum(axis=1))
        longest = np.maximum(longest, ((second - first) ** 2).sum(axis=1))
        return np.asarray(np.where(np.abs(doubles) > AREA_ROUNDING * longest, doubles / 2.0, 0.0))

    @cached_property
    def texture_edges(self) -> Ids:
        """(F, 3) int64: edges, equal where faces share them in space and in the texture."""
        both = np.stack([self.places, self.uv_ids], axis=2).reshape(-1, 2)
        return edge_ids(weld_rows(both, threads=self.options.threads).reshape(-1, 3))

    @cached_property
    def charts(self) -> IntArray:
        """(F,) int32: chart of each face, as `chart_ids` numbers them."""
        return connected_faces(self.texture_edges)

    @cached_property
    def overlaps(self) -> Overlaps:
        """Faces that lie on another in the texture."""
        return find_overlaps(self.uvs, threads=self.options.threads)

    @cached_property
    def shares_texture(self) -> BoolArray:
        """(F,) bool: faces that lie, in the texture, on faces of other groups alone."""
        overlapping, groups = self.overlaps.overlapping, self.mesh.face_groups
        if groups is None:
            return np.zeros_like(overlapping)
        within = np.zeros_like(overlapping)
        for group in np.unique(groups[overlapping]):
            faces = np.flatnonzero(groups == group)
            apart = find_overlaps(self.uvs[faces], threads=self.options.threads)
            within[faces] = apart.overlapping
        return np.asarray(overlapping & ~within)
