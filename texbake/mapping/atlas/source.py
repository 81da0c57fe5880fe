"""The surface that the charts of a mesh are made of, and what is found out about it once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from texbake.mapping.atlas.charts import Charts, ChartSurface, mesh_of
from texbake.mapping.atlas.cutting.cut import surface_of
from texbake.mapping.atlas.cutting.pockets import find_pockets
from texbake.mapping.atlas.edge_weights import EdgeWeights, edge_weights
from texbake.mapping.atlas.halves import Halves, find_halves
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.seams import regions_between
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.objects import face_objects
from texbake.progress import Stages
from texbake.records import dataclass

# Share of the area in planes from which a surface counts as a mechanical part; these have 0.6 to 1,
# scans and sculptures less than 0.1.
_FLAT_SIDED = 0.4
_HIDE = 0.5  # weight of hiding seams, if the user states none


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartSource:
    """A mesh to make charts of, or some of its faces; all candidates of `best` share one."""

    mesh: Mesh
    surface: ChartSurface
    symmetry: str
    hide_seams: float | None  # None: by default, as long as seams get hardly longer
    joined: bool  # charts will be joined, and not only with their mirror images, as in `fast`
    stages: Stages
    n_within: int = 0  # hard edges that end within a region, where no seam runs

    @classmethod
    def of_mesh(
        cls,
        mesh: Mesh,
        options: UnwrapOptions,
        stages: Stages,
        *,
        seams: BoolArray | None = None,
        protected: BoolArray | None = None,
        threads: int | None = None,
    ) -> ChartSource:
        """The surface of a mesh in its regions; `protected` (F,) faces are not cut apart."""
        regions, n_within = regions_between(
            mesh,
            hard_edges=options.seams_at_hard_edges or options.normals == "angle",
            angle=options.seam_angle,
            regions=mesh.face_groups if options.by_group else face_objects(mesh),
        )
        surface = surface_of(mesh, regions, threads, seams=seams)
        symmetry = options.symmetry
        if protected is not None:  # those on both sides of a mirror plane stay together
            surface, symmetry = surface.kept_whole(protected), "off"
        return cls(
            mesh=mesh,
            surface=surface,
            symmetry=symmetry,
            hide_seams=options.hide_seams,
            joined=options.quality != "fast",
            stages=stages,
            n_within=n_within,
        )

    def part(self, surface: ChartSurface) -> ChartSource:
        """Source of a part of the surface."""
        return ChartSource(
            mesh=mesh_of(self.mesh, surface),
            surface=surface,
            symmetry=self.symmetry,
            hide_seams=self.hide_seams,
            joined=self.joined,
            stages=self.stages,
        )

    @property
    def weights(self) -> FloatArray:
        """(F, 3) costs of seams along edges."""
        return self._edge_weights.weights

    @cached_property
    def _edge_weights(self) -> EdgeWeights:
        """The costs, and whether they are worth some length."""
        hide = _HIDE if self.hide_seams is None else self.hide_seams
        halves = self.halves if self.joined and hide > 0.0 else None
        plane = None if halves is None else halves.plane
        with self.stages.stage("weigh edges"):
            return edge_weights(self.surface, hide=hide, joined=self.joined, plane=plane)

    @cached_property
    def pockets(self) -> IntArray | None:
        """(F,) the pocket of each face, see `find_pockets`; None if there is none."""
        if not self.joined or self.hide_seams == 0.0:
            return None
        found = find_pockets(self.surface, self.weights)
        return found if found.any() else None

    @cached_property
    def apart(self) -> ChartSurface:
        """The surface, with its pockets as regions."""
        return self._with_regions(self.pockets)

    def apart_as(self, charts: Charts) -> ChartSurface:
        """The surface, with charts that are mostly in a pocket as regions."""
        if self.pockets is None:
            return self.surface
        areas = surface_areas(self.surface.points[self.surface.faces])
        owners = charts.chart_ids[charts.faces[:, 0]].astype(np.int64)
        n = int(self.pockets.max()) + 1
        sums = np.bincount(owners * n + self.pockets, areas * charts.solid, charts.n_charts * n)
        return self._with_regions(sums.reshape(-1, n).argmax(axis=1)[owners])

    def _with_regions(self, labels: IntArray | None) -> ChartSurface:
        surface = self.surface
        if labels is None:
            return surface
        keys = labels.astype(np.int64)
        if surface.regions is not None:
            keys += surface.regions.astype(np.int64) * (int(labels.max()) + 1)
        return replace(surface, regions=np.unique(keys, return_inverse=True)[1].astype(np.int32))

    @property
    def plain_weights(self) -> FloatArray | None:
        """The costs without hidden seams; None if the user wants them, or they are worth it."""
        is_fixed = self.hide_seams is not None or self._edge_weights.is_worth_length
        if is_fixed:
            return None
        with self.stages.stage("weigh edges"):
            return edge_weights(self.surface).weights

    @property
    def is_flat_sided(self) -> bool:
        """Whether much of the area lies in wide planes and their margins."""
        areas = surface_areas(self.surface.points[self.surface.faces])
        in_planes = float(areas[self.surface.bevels.owners >= 0].sum())
        return in_planes > _FLAT_SIDED * float(areas.sum())

    @cached_property
    def halves(self) -> Halves | None:
        """The halves about the mirror plane; None if there is none, or it is not asked for."""
        if self.symmetry == "off":
            return None
        with self.stages.stage("find mirror plane"):
            overlaps = self.symmetry == "overlap"
            return find_halves(self.surface, apart=overlaps, one_by_one=overlaps or self.joined)
