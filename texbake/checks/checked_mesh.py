"""A mesh that is checked, with what several checks need of it, and the findings in it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.bake_kinds import Kind
from texbake.checks.kinds import KINDS, CheckOptions
from texbake.core import portable_math as pm
from texbake.mapping.overlap import Overlaps, StackedIslands, find_overlaps
from texbake.mapping.seams import connected_faces
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, Int64Array, IntArray, Mesh, frozen
from texbake.mesh.normals import AREA_ROUNDING, face_normals
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import duplicate_faces, edge_ids, repeated_vertices
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

N_WORST = 10  # faces that a report names


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """A problem in one mesh: what it is, how often it occurs, and where."""

    kind: Kind
    severity: str  # `error`, `warning` or `note`
    mesh: str  # `low` or `high`: the mesh that has it
    count: int  # how often it occurs, in the unit of the kind
    # (n,) int32: triangles of that mesh that have it, each once, the worst first; empty where the
    # problem concerns the mesh as a whole
    faces: IntArray
    polygons: IntArray  # (n,) int32: polygons of these, each once, the worst first
    problem: str  # what goes wrong, and what to do about it
    remedy: str
    # whether the options accept its kind, so that it counts and fails nothing
    allowed: bool = False

    @property
    def name(self) -> str:
        """Identifier of its kind."""
        return self.kind.name

    @property
    def counted(self) -> str:
        """The count with its unit."""
        return self.kind.counted(self.count)

    @property
    def worst_faces(self) -> list[int]:
        """Its ten worst faces, counted as in the file."""
        worst: list[int] = self.polygons[:N_WORST].tolist()
        return worst

    def to_json(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return {
            "name": self.name,
            "title": self.kind.title,
            "severity": self.severity,
            "allowed": self.allowed,
            "mesh": self.mesh,
            "count": self.count,
            "unit": self.kind.unit[1],
            "n_faces": len(self.polygons),
            "worst_faces": self.worst_faces,
            "problem": self.problem,
            "remedy": self.remedy,
        }


@dataclass(frozen=True, eq=False)
class SurfaceEdges:
    """The edges of a surface, and the faces at each."""

    faces: Int64Array  # (n,) int64; the faces whose edges these are, ascending
    ids: Int64Array  # (n, 3) int64; number of the edge from each of their corners to the next
    counts: Int64Array  # (E,) int64; how many faces have each edge
    # (3 n,) int64; half-edges, 3 i + c for corner c of the i-th of `faces`, sorted by edge, then by
    # number.
    ordered: Int64Array
    starts: Int64Array  # (E,) int64; index in `ordered` of the first half-edge of each edge

    @classmethod
    def of(cls, corners: npt.NDArray[np.integer[Any]], faces: Int64Array) -> SurfaceEdges:
        """Return the edges of some faces, from the (F, 3) corners of all."""
        ids = edge_ids(corners[faces])
        counts = np.bincount(ids.ravel())
        ordered = np.argsort(ids.ravel(), kind="stable")
        return cls(faces, ids, counts, ordered, np.cumsum(counts) - counts)

    def pairs(self) -> tuple[Int64Array, Int64Array]:
        """Both half-edges of each edge that exactly two faces share."""
        firsts = self.starts[self.counts == 2]
        return self.ordered[firsts], self.ordered[firsts + 1]

    def faces_at(self, edges: BoolArray) -> tuple[Int64Array, Int64Array]:
        """Faces at the edges selected by (E,) bool, and for each of them the edge."""
        rows, corners = np.nonzero(edges[self.ids])
        return self.faces[rows], self.ids[rows, corners]


class CheckedMesh:
    """A mesh, its role, and its properties that several checks need, computed once."""

    def __init__(self, mesh: Mesh, role: str, options: CheckOptions) -> None:
        self.mesh = mesh
        self.role = role
        self.options = options
        # A power of two: lengths and areas can be computed at any size, and no bit is lost.
        self.scale = unit_scale(float(np.abs(mesh.bounds).max()))

    @cached_property
    def positions(self) -> FloatArray:
        """(V, 3) float64: positions times `scale`, in [-1, 1] if a face uses them."""
        with np.errstate(over="ignore"):  # of those that none uses
            return frozen(self.mesh.positions * self.scale)

    @cached_property
    def corners(self) -> FloatArray:
        """(F, 3, 3) float64: scaled positions of the corners."""
        return self.positions[self.mesh.faces]

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, scaled."""
        low, high = self.mesh.bounds * self.scale
        return float(pm.norm(high - low))

    @cached_property
    def firsts(self) -> IntArray:
        """(V,) int32: for each vertex, the first one of its object at the same place."""
        return weld_vertices(self.mesh, threads=self.options.threads)

    @cached_property
    def places(self) -> IntArray:
        """(F, 3) int32: numbers of places, equal for corners at the same place."""
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
        return np.asarray(np.where(self.has_area, pm.norm(crosses, axis=1) / 2.0, 0.0))

    @cached_property
    def duplicates(self) -> BoolArray:
        """(F,) bool: faces with the same three places as an earlier face."""
        return np.asarray(duplicate_faces(self.places) & ~repeated_vertices(self.places))

    @cached_property
    def edges(self) -> SurfaceEdges:
        """Edges between places, of faces with three different places that repeat no other face."""
        kept = ~self.duplicates & ~repeated_vertices(self.places)
        return SurfaceEdges.of(self.places, np.flatnonzero(kept))

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
        """(F, 3) int32: numbers of texture coordinates, equal where these are equal."""
        assert self.mesh.uvs is not None
        return weld_rows(self.mesh.uvs, threads=self.options.threads)[self.mesh.uv_faces]

    @cached_property
    def uv_areas(self) -> FloatArray:
        """(F,) float64: signed areas in the texture, 0 where they are within rounding."""
        a, b, c = (self.uvs[:, corner] for corner in range(3))
        first, second = b - a, c - a
        doubles = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        longest = np.maximum((first**2).sum(axis=1), (second**2).sum(axis=1))
        longest = np.maximum(longest, ((second - first) ** 2).sum(axis=1))
        return np.asarray(np.where(np.abs(doubles) > AREA_ROUNDING * longest, doubles / 2.0, 0.0))

    @cached_property
    def texture_edges(self) -> Int64Array:
        """(F, 3) int64: numbers of edges, equal where faces share them in space and texture."""
        both = np.stack([self.places, self.uv_ids], axis=2).reshape(-1, 2)
        return edge_ids(weld_rows(both, threads=self.options.threads).reshape(-1, 3))

    @cached_property
    def charts(self) -> IntArray:
        """(F,) int32: chart of each face, as `chart_ids` numbers them."""
        return connected_faces(self.texture_edges)

    @cached_property
    def stacked(self) -> StackedIslands:
        """Islands of texture coordinates that coincide."""
        return StackedIslands.of(self.mesh)

    @cached_property
    def baked(self) -> Mesh:
        """The mesh as it is baked: with one of each stack of islands."""
        return self.stacked.baked(self.mesh)

    @cached_property
    def overlaps(self) -> Overlaps:
        """Which faces overlap another in the texture, other than stacked islands."""
        return find_overlaps(self.baked.corner_uvs(), threads=self.options.threads)

    @cached_property
    def shares_texture(self) -> BoolArray:
        """(F,) bool: faces that overlap, in the texture, only faces of other groups."""
        overlapping, groups = self.overlaps.overlapping, self.mesh.face_groups
        if groups is None:
            return np.zeros_like(overlapping)
        within = np.zeros_like(overlapping)
        for group in np.unique(groups[overlapping]):
            faces = np.flatnonzero(groups == group)
            apart = find_overlaps(self.baked.corner_uvs()[faces], threads=self.options.threads)
            within[faces] = apart.overlapping
        return np.asarray(overlapping & ~within)

    def finding(
        self,
        name: str,
        count: int | np.integer[Any],
        faces: AnyArray | None = None,
        badness: AnyArray | None = None,
        **figures: Any,
    ) -> Finding | None:
        """Make a finding about this mesh; see `make_finding`."""
        return make_finding(name, self.role, count, faces, badness, **figures)

    def flag(
        self, name: str, flagged: BoolArray, badness: AnyArray | None = None, **figures: Any
    ) -> Finding | None:
        """Make a finding about faces from a flag, (F,), and how bad it is, (F,), for each."""
        faces = np.flatnonzero(flagged)
        worst = None if badness is None else badness[faces]
        return make_finding(name, self.role, len(faces), faces, worst, **figures)


Look = Callable[[CheckedMesh], Finding | None]


def make_finding(
    name: str,
    mesh: str,
    count: int | np.integer[Any],
    faces: AnyArray | None = None,
    badness: AnyArray | None = None,
    **figures: Any,
) -> Finding | None:
    """Make a finding on `faces` (n,), worst by `badness`; None where nothing was counted."""
    if not count:
        return None
    kind = KINDS[name]
    faces = _worst_first(faces, badness)
    return Finding(
        kind=kind,
        severity=(mesh == "high" and kind.in_high) or kind.severity,
        mesh=mesh,
        count=int(count),
        faces=faces,
        polygons=faces,
        problem=kind.problem.format(**figures),
        remedy=kind.remedy.format(**figures),
    )


def _worst_first(faces: AnyArray | None, badness: AnyArray | None) -> IntArray:
    if faces is None:
        return np.zeros(0, dtype=np.int32)
    if badness is None:
        return np.unique(faces).astype(np.int32)
    # A repeated face takes its worst place; of equals, the lower number comes first.
    ordered = faces[np.lexsort((faces, -badness))]
    _, firsts = np.unique(ordered, return_index=True)
    return np.asarray(ordered[np.sort(firsts)], dtype=np.int32)
