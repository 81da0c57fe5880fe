"""Charts: a mesh flattened piece by piece, as cutting, joining and packing pass it on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import UvError, counted
from texbake.mapping.atlas.bevels import Bevels, find_bevels
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas, surface_areas
from texbake.mapping.seams import chart_ids, merged_labels
from texbake.mesh.compose import offset_joined
from texbake.mesh.frame import UnitGrid
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.topology import next_half_edges, opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.raycast.openness import openness
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartSurface:
    """The surface of a mesh that charts are made of."""

    points: FloatArray  # (V, 3) float64; on the grid, in the unit cube
    faces: IntArray  # (F, 3) int32
    polygons: IntArray | None = None  # (F,) int32; triangles of one stay together if they can
    regions: IntArray | None = None  # (F,) int32; faces of different ones share no chart
    seams: BoolArray | None = None  # (F, 3); the only edges along which charts are cut
    # Area of all charts; None for that of the faces, which are the whole surface then.
    area: float | None = None
    threads: int | None = None

    @cached_property
    def corners(self) -> IntArray:
        """(F, 3) int32: vertices of the faces, equal at one place."""
        return weld_rows(self.points, threads=self.threads)[self.faces]

    @cached_property
    def joints(self) -> tuple[IntArray, npt.NDArray[np.bool_], IntArray]:
        """The corners; (F,) faces with three different ones; `opposite` of those faces."""
        solid = (self.corners != np.roll(self.corners, 1, axis=1)).all(axis=1)
        return self.corners, solid, self.opposite(solid)

    @cached_property
    def bevels(self) -> Bevels:
        """The hard edges, beveled or not."""
        corners, _, opposite = self.joints
        return find_bevels(self.points, corners, opposite)

    @cached_property
    def openness(self) -> FloatArray:
        """(V,) open share of the surroundings of vertices, on the side of the normals."""
        corners, solid, _ = self.joints
        return openness(self.points, corners[solid], threads=self.threads)

    def opposite(self, solid: npt.NDArray[np.bool_]) -> IntArray:
        """(3 F,) int32: `opposite_half_edges` of the `solid` faces."""
        opposite = opposite_half_edges(
            self.corners, solid=solid, regions=self.regions, polygons=self.polygons
        )
        return opposite if self.seams is None else np.where(self.seams.ravel(), -1, opposite)

    def kept_whole(self, protected: BoolArray) -> ChartSurface:
        """Treat neighboring `protected` (F,) faces as one polygon, cut only where it must be."""
        own = np.arange(len(self.faces), dtype=np.int32)
        polygons = own if self.polygons is None else self.polygons
        edges, across = _inner_edges(self, protected)
        merged = merged_labels(len(own), polygons[edges // 3], polygons[across // 3])
        return replace(self, polygons=merged[polygons])

    def part(self, face_ids: IntArray) -> ChartSurface:
        """Surface of some faces (n,)."""
        polygons, regions = (
            None if labels is None else labels[face_ids] for labels in (self.polygons, self.regions)
        )
        seams = None if self.seams is None else self.seams[face_ids]
        return replace(
            self, faces=self.faces[face_ids], polygons=polygons, regions=regions, seams=seams
        )


def mesh_of(mesh: Mesh, part: ChartSurface) -> Mesh:
    """Mesh of the faces of a part of its surface, with all vertices."""
    return Mesh(
        positions=mesh.positions, faces=part.faces, polygon_of=part.polygons, name=mesh.name
    )


def _inner_edges(surface: ChartSurface, faces: BoolArray) -> tuple[IntArray, IntArray]:
    """Half-edges between some faces (F,), each edge once, and their opposites."""
    opposite = surface.joints[2]
    edges = np.flatnonzero(opposite > np.arange(len(opposite))).astype(np.int32)
    edges = edges[faces[edges // 3] & faces[opposite[edges] // 3]]
    return edges, opposite[edges]


def with_cuts_noted(
    surface: ChartSurface, charts: Charts, faces: BoolArray, *, max_stretch: float | None
) -> Charts:
    """Note how many edges between protected faces (F,) are seams."""
    uncut = replace(surface, seams=None, regions=None)
    edges, across = _inner_edges(uncut, faces & charts.solid)
    ends = edges, next_half_edges(edges), next_half_edges(across), across
    tail, head, other_tail, other_head = (charts.faces.ravel()[each] for each in ends)
    is_cut = (charts.uvs[tail] != charts.uvs[other_tail]).any(axis=1)
    is_cut |= (charts.uvs[head] != charts.uvs[other_head]).any(axis=1)
    is_cut |= charts.chart_ids[tail] != charts.chart_ids[other_tail]
    is_asked = is_cut & (surface.joints[2][edges] < 0)
    within = "" if max_stretch is None else " within `max_stretch`"
    counts = (
        (is_asked, "between protected faces {} at a marked seam, a hard edge or another group"),
        (is_cut & ~is_asked, "between protected faces {} cut to lay them flat" + within),
    )
    notes = [
        counted(n, "edge ", "edges ") + note.format("is" if n == 1 else "are")
        for n, note in ((int(np.count_nonzero(cut)), note) for cut, note in counts)
        if n
    ]
    return replace(charts, notes=(*charts.notes, *notes)) if notes else charts


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """A mesh flattened piece by piece, each chart about its own origin."""

    # (T, 2) float64; coordinates in the unit of the points: a chart has the area that its faces
    # have in space.
    uvs: FloatArray
    # (F, 3) int32; indices into `uvs`; all three are equal in a face without a chart.
    faces: IntArray
    # (T,) int32; chart of each coordinate; charts are numbered from 0 without gaps.
    chart_ids: IntArray
    n_ignored: int = 0  # faces without a chart, because they have almost no area on the grid
    n_mirrored: int = 0  # charts that came out mirrored and were flipped
    n_split: int = 0  # charts that were split off because they overlapped their own chart
    # (F,) bool; faces on the coordinates of their mirror images; None if there are none.
    stacked: BoolArray | None = None
    # Notes for the report: steps that failed and what was done instead, charts that miss a bound
    # and why.
    notes: tuple[str, ...] = ()

    @property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart_ids.max()) + 1

    @property
    def packed_faces(self) -> IntArray:
        """(n, 3): `faces` without those that lie on others."""
        return self.packed(self.faces)

    def packed(self, faces: IntArray) -> IntArray:
        """(n, 3): rows of (F, 3) of the faces that do not lie on others."""
        return faces if self.stacked is None else faces[~self.stacked]

    @property
    def solid(self) -> npt.NDArray[np.bool_]:
        """(F,) bool: faces that lie in a chart."""
        return np.asarray((self.faces != self.faces[:, :1]).any(axis=1))


def with_shapes_noted(all_charts: Sequence[Charts], reshaped: BoolArray) -> list[Charts]:
    """Note the charts of each mesh that packing has reshaped."""
    starts = np.cumsum([charts.n_charts for charts in all_charts])[:-1]
    noted = []
    for charts, own in zip(all_charts, np.split(reshaped, starts), strict=True):
        if own.any():
            note = (
                f"{counted(int(own.sum()), 'long strip')} would own hardly any texels: shown "
                "shorter and wider in the texture"
            )
            charts = replace(charts, notes=(*charts.notes, note))
        noted.append(charts)
    return noted


_MOST_IMPORTANT = 4.0  # texels per unit of length of white charts, in those of black ones


def enlarged(charts: Charts, factor: float, importance: FloatArray | None) -> Charts:
    """Charts times a factor, and each by the mean `importance` (F,) of its faces."""
    if importance is None:
        return replace(charts, uvs=charts.uvs * factor)
    owners = charts.chart_ids[charts.faces[:, 0]]
    areas = np.abs(signed_areas(charts.uvs[charts.faces]))
    totals, sums = (
        np.bincount(owners, weights, minlength=charts.n_charts)
        for weights in (areas, areas * importance)
    )
    means = np.divide(sums, totals, out=np.zeros_like(sums), where=totals > 0.0)
    factors = factor * np.asarray(pm.power(_MOST_IMPORTANT, means))
    return replace(charts, uvs=charts.uvs * factors[charts.chart_ids][:, None])


def gather_charts(
    mesh_faces: IntArray, pieces: Sequence[tuple[IntArray, Charts]], notes: tuple[str, ...] = ()
) -> Charts:
    """Combine charts of parts of a mesh, given as faces (n,) and charts; others get none."""
    faces = np.zeros_like(mesh_faces)
    face_ids = np.concatenate([face_ids for face_ids, _ in pieces])
    faces[face_ids] = offset_joined([(charts.faces, len(charts.uvs)) for _, charts in pieces])
    solid = np.flatnonzero((faces != faces[:, :1]).any(axis=1))
    return Charts(
        uvs=np.concatenate([charts.uvs for _, charts in pieces]),
        faces=_with_anchors(mesh_faces, solid, faces[solid]),
        chart_ids=offset_joined([(charts.chart_ids, charts.n_charts) for _, charts in pieces]),
        n_ignored=len(mesh_faces) - len(solid),
        n_mirrored=sum(charts.n_mirrored for _, charts in pieces),
        n_split=sum(charts.n_split for _, charts in pieces),
        notes=notes + tuple(note for _, charts in pieces for note in charts.notes),
    )


def _with_anchors(
    mesh_faces: IntArray, solid: npt.NDArray[np.integer], faces: npt.NDArray[np.integer]
) -> IntArray:
    """(F, 3): `faces` for solid faces; else a single coordinate, of a solid one if possible."""
    none = np.iinfo(np.int32).max
    at_vertex = np.full(int(mesh_faces.max()) + 1, none, dtype=np.int64)
    np.minimum.at(at_vertex, mesh_faces[solid].ravel(), faces.ravel())
    anchors = at_vertex[mesh_faces].min(axis=1)
    all_faces = np.repeat(np.where(anchors < none, anchors, 0)[:, None], 3, axis=1)
    all_faces[solid] = faces
    return all_faces.astype(np.int32)


def border_length(surface: ChartSurface, charts: Charts) -> float:
    """Length of the borders between charts of a surface, in its units, each counted twice."""
    corners, _, opposite = surface.joints
    labels = charts.chart_ids[charts.faces[:, 0]]
    is_border = (opposite >= 0) & (labels[opposite // 3] != np.repeat(labels, 3))
    steps = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
    return float(pm.norm(steps.reshape(-1, 3)[is_border], axis=1).sum())


def existing_charts(
    mesh: Mesh, size: tuple[int, int], *, regions: IntArray | None = None
) -> Charts:
    """Charts of a mesh's uvs, made for `size` texels; none is shared by two `regions` (F,)."""
    corners = measurable_uvs(mesh) * (np.array(size) / max(size))
    in_texture = float(np.abs(signed_areas(corners)).sum())
    points = UnitGrid.around(mesh).to_grid(mesh.positions)
    in_space = float(surface_areas(points[mesh.faces]).sum())
    if not (in_texture > 0.0 and in_space > 0.0):
        raise UvError(f"{mesh.name}: its faces have no area in the texture; unwrap it without keep")
    assert mesh.uv_faces is not None
    ids = chart_ids(mesh)
    if regions is not None:
        pairs = (ids.astype(np.int64) << 32) + regions
        ids = np.unique(pairs, return_inverse=True)[1].astype(np.int32)
    face_charts = np.repeat(ids.reshape(-1, 1), 3, axis=1)
    keys = (face_charts.astype(np.int64) << 32) + mesh.uv_faces
    _, firsts, faces = np.unique(keys, return_index=True, return_inverse=True)
    return Charts(
        uvs=corners.reshape(-1, 2)[firsts] * math.sqrt(in_space / in_texture),
        faces=faces.reshape(-1, 3).astype(np.int32),
        chart_ids=face_charts.ravel()[firsts].astype(np.int32),
    )


# Faces without neighbors, as soups of triangles have them, are charts of their own if there are
# more than this: cutting, relaxing and joining take a fraction of a millisecond for each of them,
# and can do nothing for it.
_MANY = 1000


def find_isolated_faces(surface: ChartSurface) -> tuple[IntArray, IntArray]:
    """Isolated faces (n,) with area, if many, and those with neighbors (m,); else none, and all."""
    points, faces = surface.points, surface.faces
    _, solid, opposite = surface.joints
    continued = (opposite.reshape(-1, 3) >= 0).any(axis=1)
    isolated = np.flatnonzero(solid & ~continued).astype(np.int32)
    isolated = isolated[surface_areas(points[faces[isolated]]) > 0.0]
    if len(isolated) <= _MANY:
        return isolated[:0], np.arange(len(faces), dtype=np.int32)
    return isolated, np.flatnonzero(continued).astype(np.int32)


def single_face_charts(points: FloatArray, faces: IntArray) -> Charts:
    """Lay each face (F, 3) of points (V, 3) flat as a chart of its own."""
    n_faces = len(faces)
    uvs = flatten_triangles(points[faces])
    return Charts(
        uvs=(uvs - uvs.mean(axis=1, keepdims=True)).reshape(-1, 2),
        faces=np.arange(3 * n_faces, dtype=np.int32).reshape(-1, 3),
        chart_ids=np.repeat(np.arange(n_faces, dtype=np.int32), 3),
    )


def flatten_triangles(corners: FloatArray) -> FloatArray:
    """(F, 3, 2) float64: triangles placed in the plane, with their lengths, counter-clockwise."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    lengths = pm.norm(first, axis=1)
    flat = np.zeros((len(corners), 3, 2))
    flat[:, 1, 0] = lengths
    flat[:, 2, 0] = pm.vecdot(first, second) / lengths
    flat[:, 2, 1] = 2.0 * surface_areas(corners) / lengths
    return flat


def groups_in_use(meshes: Sequence[Mesh]) -> set[str]:
    """Names of the groups that have faces; "" is for meshes without groups."""
    return {
        mesh.group_names[group]
        for mesh in meshes
        if mesh.face_groups is not None
        for group in np.unique(mesh.face_groups)
    } | {"" for mesh in meshes if mesh.face_groups is None}


def tile_groups(meshes: Sequence[Mesh], all_charts: Sequence[Charts]) -> IntArray:
    """Group of each chart; groups of the same name in several meshes count as one."""
    names: dict[str, int] = {}
    groups = []
    for mesh, charts in zip(meshes, all_charts, strict=True):
        of_chart = np.zeros(charts.n_charts, dtype=np.int32)
        numbers = np.array(
            [names.setdefault(name, len(names)) for name in mesh.group_names or ("",)],
            dtype=np.int32,
        )
        solid = charts.solid if charts.stacked is None else charts.solid & ~charts.stacked
        if mesh.face_groups is not None:
            face_charts = charts.chart_ids[charts.faces[solid, 0]]
            of_chart[face_charts] = numbers[mesh.face_groups[solid]]
        else:
            of_chart[:] = numbers[0]
        groups.append(of_chart)
    # Numbered without gaps, so that a group without faces takes no tile.
    return np.unique(np.concatenate(groups), return_inverse=True)[1].astype(np.int32)
