"""Remesh any triangles as a manifold surface: closed, around what is seen from outside, or open.

Holes of a body are filled first. Open surfaces are remeshed as sheets; see `remeshing.sheets`.

The mesh is put into a grid of voxels. What a ball cannot reach from outside, because all gaps are
too narrow for it, is solid: inner walls vanish, overlapping parts become one, and holes are closed.
The surface of the solid is then moved onto the mesh wherever no face folds. A sheet without
thickness is wrapped on both sides. Cavities, which the mesh winds around less than half a time, can
be kept.

Based on: Cédric Portaneri, Mael Rouxel-Labbé, Michael Hemmer, David Cohen-Steiner, Pierre Alliez,
"Alpha Wrapping with an Offset", ACM Transactions on Graphics 41(4), 2022 (what a ball can reach).
Departs from it in that voxels are flooded and not tetrahedra carved.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from texbake.errors import MeshError
from texbake.mesh.distance import OneSidedDistance, distance_to, face_areas
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.options import AUTO, CLOSED, OPEN, RemeshOptions
from texbake.mesh.remeshing.band import SHELL_DEPTH, Band, Grid
from texbake.mesh.remeshing.boundary import (
    AS_IT_IS,
    Filled,
    Kind,
    Loops,
    count_loops,
    fill_holes,
    kind_of,
    require_topology,
)
from texbake.mesh.remeshing.parts import (
    Parts,
    largest_parts,
    winding_numbers,
    without_crumbs,
    without_cut_off,
)
from texbake.mesh.remeshing.projection import SHARP_ANGLE, project
from texbake.mesh.remeshing.sheets import PIERCED, build_body, largest_sheets, remesh_sheets
from texbake.mesh.remeshing.solid import flood_outside
from texbake.mesh.simplify import check_count, simplify
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import Progress, Stages
from texbake.records import dataclass

_MORE = "request more, or use a wider `close` or fewer `components`"
_MOST_FACES_SUMMED = 2e8  # for winding numbers in all rooms
_AREA_KEPT = 0.02  # change of a sheet's area that is not worth a note


@dataclass(frozen=True, kw_only=True)
class RemeshReport:
    """Figures of a run of `remesh`."""

    n_faces_before: int
    n_faces: int
    n_vertices: int
    n_components: int  # separate parts of the result, and those that `components` left out
    n_dropped: int
    n_crumbs: int  # separate parts smaller than a voxel, which are left out
    n_cut_off: int  # small parts that were cut off at thin places of the mesh, which are left out
    # walls of cavities in the result; closed rooms of several voxels in the solid, wider than the
    # gaps that are closed
    n_cavities_kept: int
    n_cavities_filled: int
    # Such rooms that were too small and too many to test whether they are cavities. They count as
    # solid.
    n_rooms_untested: int
    voxel: float  # side of a voxel, in model units
    gap: float  # gaps up to this width are closed, in model units
    surface: str  # what the result is, `closed` or `open`
    reason: str  # why it is that, as the end of a sentence
    # loops of the mesh's boundary that were filled, and loops of the boundary of an open result
    n_holes_filled: int
    n_boundaries: int
    # handles of a closed result that the mesh, if it is one part, does not have
    n_handles_made: int
    # area of an open result, as a share of that of the mesh and what fills its holes
    area_ratio: float
    # share of the wrap's vertices, before it is simplified, that lie around sheets
    thin_share: float
    # From the result to the given mesh. It includes the surfaces that close gaps.
    distance: OneSidedDistance
    diagonal: float  # of the given mesh
    seconds: float  # without measuring the distance

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        notes = []
        if self.n_crumbs:
            notes.append(
                f"separate parts smaller than a voxel are left out: {self.n_crumbs:,}; a greater "
                "`resolution` keeps more"
            )
        if self.n_cut_off:
            notes.append(
                "small parts that were cut off at thin places of the mesh are left out: "
                f"{self.n_cut_off:,}; another `resolution` may keep them"
            )
        if self.n_dropped:
            notes.append(
                f"{self.n_dropped:,} smaller separate parts were dropped; `components` keeps them"
            )
        if self.n_rooms_untested:
            notes.append(
                "the smallest rooms inside were not tested for being cavities, and count as "
                f"solid: {self.n_rooms_untested:,}; a lower `resolution` leaves fewer"
            )
        if self.n_handles_made:
            notes.append(
                "closing gaps made handles that the mesh does not have: "
                f"{self.n_handles_made:,}; a smaller `close` or a greater `resolution` makes fewer"
            )
        if abs(self.area_ratio - 1.0) > _AREA_KEPT:
            notes.append(
                f"the sheet has {100.0 * self.area_ratio:.0f} % of the mesh's area; a greater "
                "`resolution` keeps more of its detail"
            )
        return (*notes, *self.distance.notes)

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        return asdict(self)


def remesh(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: Progress = None,
    threads: int | None = None,
) -> Mesh:
    """Wrap a mesh in a closed surface, or remesh an open one as sheets.

    Parameters
    ----------
    mesh
        Any triangles, in any orientation.
    options
        None for the defaults.
    progress
        True shows a bar for the running stage; a listener is called with each stage.
    threads
        None for every processor; the result does not depend on it.

    Returns
    -------
    Mesh
        Manifold; closed and facing outwards, or into the cavities that are kept, unless it is
        open; with the groups and colors of the nearest points of the given mesh. It has no texture
        coordinates and no normals of its own.

    Raises
    ------
    OptionError
        The gaps to close are too wide for the resolution.
    MeshError
        The mesh has no extent, its triangles fill the grid many times over, or the result has more
        separate parts than it, or more handles and holes.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> from texbake.mesh.topology import find_edges
    >>> find_edges(remesh(plane(), RemeshOptions(resolution=16)).faces).closed
    False
    """
    run = _Run.of(as_mesh(mesh), options or RemeshOptions(), Stages(progress), threads)
    return run.remeshed()[0]


def looks_open(mesh: Mesh, *, threads: int | None = None) -> bool:
    """Return whether `remesh` keeps a mesh open."""
    points = Grid.around(mesh, RemeshOptions()).to_voxels(mesh.positions)
    return kind_of(points, mesh.faces, threads=threads).is_open


def remesh_with_thinness(
    mesh: Mesh, options: RemeshOptions, *, threads: int | None = None
) -> tuple[Mesh, float, float]:
    """Wrap a mesh without filling holes; also return a voxel's side, and `thin_share`."""
    run = _Run.of(mesh, options, Stages(None), threads)
    wrapped, counts = run.remeshed(fills_holes=False)
    return wrapped, run.grid.voxel, counts.thin_share


def remesh_with_report(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: Progress = None,
    threads: int | None = None,
) -> tuple[Mesh, RemeshReport]:
    """Remesh a mesh, and report how far the result lies from it."""
    mesh, stages = as_mesh(mesh), Stages(progress)
    start = time.perf_counter()
    run = _Run.of(mesh, options or RemeshOptions(), stages, threads)
    wrapped, counts = run.remeshed(counts_cavities=True)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = distance_to(wrapped, mesh, threads=threads)
    report = RemeshReport(
        n_faces_before=mesh.n_faces,
        n_faces=wrapped.n_faces,
        n_vertices=wrapped.n_vertices,
        voxel=run.grid.voxel,
        gap=run.grid.gap * run.grid.voxel,
        distance=distance,
        diagonal=mesh.diagonal,
        seconds=seconds,
        **vars(counts),
    )
    return wrapped, report


@dataclass(frozen=True, kw_only=True)
class _Counts:
    """Figures of `RemeshReport` that the steps find."""

    n_components: int
    n_dropped: int
    n_crumbs: int
    n_cut_off: int = 0
    n_cavities_kept: int = 0
    n_cavities_filled: int = 0
    n_rooms_untested: int = 0
    thin_share: float = 0.0
    surface: str = CLOSED
    reason: str = ""
    n_holes_filled: int = 0
    n_boundaries: int = 0
    n_handles_made: int = 0
    area_ratio: float = 1.0


@dataclass(frozen=True, eq=False)
class _Run:
    """A mesh that is remeshed, with its points in units of a voxel."""

    mesh: Mesh
    options: RemeshOptions
    stages: Stages
    threads: int | None
    grid: Grid
    points: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, options: RemeshOptions, stages: Stages, threads: int | None) -> _Run:
        """Put a mesh into its grid."""
        grid = Grid.around(mesh, options)
        return cls(mesh, options, stages, threads, grid, grid.to_voxels(mesh.positions))

    def remeshed(
        self, *, counts_cavities: bool = False, fills_holes: bool = True
    ) -> tuple[Mesh, _Counts]:
        """Return the new surface, and what was found and left out on the way."""
        mesh = self.mesh
        kind, filled, n_parts, whole = AS_IT_IS, Filled.of(mesh.faces), mesh.n_faces, None
        if fills_holes:
            with self.stages.stage("find boundary"):
                kind, filled = self._filled()
                n_parts = face_components(kind.faces, mesh.n_vertices)[1]
            if n_parts == 1:
                whole = filled.faces if filled.n_holes else kind.faces
        if kind.is_open:
            moved, faces, n_handles, counts = self._sheet(filled)
        else:
            moved, faces, n_handles, counts = self._wrap(
                filled, n_parts, whole, counts_cavities=counts_cavities
            )
        n_filled, n_made = filled.n_holes, 0
        if kind.is_open and counts.n_dropped == 0:  # some holes are narrower than the voxels
            n_parts_gone = n_parts - counts.n_components
            n_filled = max(n_filled, len(kind.loops.sizes) - counts.n_boundaries - n_parts_gone)
        if fills_holes:
            may_be_pierced = filled.n_holes > 0 or counts.thin_share > PIERCED
            n_after = counts.n_components, n_handles, counts.n_boundaries
            n_made = require_topology(
                mesh.name, kind, n_parts, *n_after, may_be_pierced=may_be_pierced
            )
        counts = replace(counts, reason=kind.reason, n_holes_filled=n_filled, n_handles_made=n_made)
        return self._finished(moved, faces), counts

    def _finished(self, moved: FloatArray, faces: IntArray) -> Mesh:
        """Return the surface in model units, with normals, as few faces, and attributes."""
        mesh, options = self.mesh, self.options
        wrapped = Mesh(positions=self.grid.to_model(moved), faces=faces, name=mesh.name)
        if options.sharp_edges:
            wrapped = with_normals(wrapped, "angle", angle=SHARP_ANGLE)
        if options.n_faces is not None:
            wrapped = simplify(
                wrapped, options.n_faces, quality=options.quality, threads=self.threads
            )
            check_count(wrapped.n_faces, options.n_faces, mesh.name, _MORE)
        return with_nearest_attributes(wrapped, mesh, self.threads)

    def _filled(self) -> tuple[Kind, Filled]:
        """Choose between an open surface and a body, and fill holes accordingly."""
        options = self.options
        kind = kind_of(self.points, self.mesh.faces, threads=self.threads)
        if options.surface != AUTO:
            kind = replace(kind, is_open=options.surface == OPEN, reason="as requested")
        elif options.keep_interior and kind.is_open:
            kind = replace(kind, is_open=False, reason="its interior is kept")
        if kind.is_open and kind.is_one_sided:
            raise MeshError(
                f"{self.mesh.name}: its sheets have one side only; use `surface={CLOSED}`"
            )
        filled = fill_holes(self.points, kind, self.grid.gap, whole=options.surface == CLOSED)
        return kind, filled if kind.is_open or filled.n_holes else Filled.of(self.mesh.faces)

    def _wrap(
        self, filled: Filled, n_parts: int, whole: IntArray | None, *, counts_cavities: bool
    ) -> tuple[FloatArray, IntArray, int, _Counts]:
        """Wrap a body of some separate parts in a closed surface, or one `whole` part."""
        points, options, threads = self.points, self.options, self.threads
        keep_interior = options.keep_interior

        def measure_windings(of_rooms: FloatArray) -> FloatArray:
            # A soup of triangles has tens of thousands of rooms; only the largest are tested.
            faces = self.mesh.faces
            return winding_numbers(
                points, faces, of_rooms, most_work=_MOST_FACES_SUMMED, threads=threads
            )

        with self.stages.stage("measure voxels"):
            band = Band.around(points, filled.faces, self.grid, threads=threads)
            labels = band.labels(threads=threads)
        with self.stages.stage("find outside"):
            rooms = flood_outside(
                labels,
                self.grid.gap / 2.0 - SHELL_DEPTH,
                measure_windings if counts_cavities or keep_interior else None,
                keep_cavities=keep_interior,
                threads=threads,
            )
        with self.stages.stage("build surface"):
            nets = build_body(band, labels, points, filled, whole, threads=threads)
        del band, labels
        with self.stages.stage("project"):
            tree = TriangleTree.build(points, filled.faces, threads=threads)
            moved, faces = project(
                nets, tree, sharp_edges=options.sharp_edges, smooth=filled.smooth, threads=threads
            )
        parts, n_crumbs = without_crumbs(Parts.of(moved, faces), keep_cavities=keep_interior)
        parts, n_cut_off = without_cut_off(parts, n_parts)
        parts, n_dropped = largest_parts(parts, options.n_components, threads=threads)
        moved, faces = parts.points, parts.faces
        counts = _Counts(
            n_components=int(np.count_nonzero(~parts.is_wall)),
            n_cavities_kept=int(np.count_nonzero(parts.is_wall)),
            n_cavities_filled=0 if keep_interior else rooms.n_cavities,
            n_rooms_untested=rooms.n_untested,
            n_dropped=n_dropped,
            n_crumbs=n_crumbs,
            n_cut_off=n_cut_off,
            thin_share=float(np.mean(nets.thin)),
        )
        n_handles = len(parts.volumes) - (len(moved) - len(faces) // 2) // 2  # edges have two faces
        return moved, faces, n_handles, counts

    def _sheet(self, filled: Filled) -> tuple[FloatArray, IntArray, int, _Counts]:
        """Remesh an open surface as sheets."""
        options, threads = self.options, self.threads
        with self.stages.stage("build sheets"):
            moved, faces, n_crumbs = remesh_sheets(
                self.points, filled, self.grid, sharp_edges=options.sharp_edges, threads=threads
            )
        moved, faces, n_dropped = largest_sheets(moved, faces, options.n_components)
        n_boundaries = len(Loops.of(moved, faces).sizes)
        new_areas = face_areas(moved, faces, threads=threads)
        old_areas = face_areas(self.points, filled.faces, threads=threads)
        counts = _Counts(
            n_components=face_components(faces, len(moved))[1],
            n_dropped=n_dropped,
            n_crumbs=n_crumbs,
            n_boundaries=n_boundaries,
            surface=OPEN,
            area_ratio=float(new_areas.sum()) / float(old_areas.sum()),
        )
        return moved, faces, (count_loops(faces) - n_boundaries) // 2, counts
