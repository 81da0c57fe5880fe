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
from dataclasses import dataclass, replace

import numpy as np

from texbake.errors import MeshError
from texbake.mesh.distance import face_areas, surface_distance
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.options import AUTO, CLOSED, OPEN, RemeshOptions
from texbake.mesh.remesh_report import RemeshReport
from texbake.mesh.remeshing.band import SHELL_DEPTH, Band, CrowdedGridError, Grid, too_crowded
from texbake.mesh.remeshing.flood import Rooms, flood_outside
from texbake.mesh.remeshing.holes import NO_LOOPS, Loops
from texbake.mesh.remeshing.parts import (
    Parts,
    largest_parts,
    winding_numbers,
    without_crumbs,
    without_cut_off,
)
from texbake.mesh.remeshing.projection import project
from texbake.mesh.remeshing.sharp_edges import SHARP_ANGLE
from texbake.mesh.remeshing.sheets import (
    PIERCED,
    NoSheetError,
    build_body,
    largest_sheets,
    remesh_sheets,
)
from texbake.mesh.remeshing.sides import (
    AS_IT_IS,
    Filled,
    Kind,
    count_loops,
    fill_holes,
    kind_of,
    require_topology,
)
from texbake.mesh.simplify import check_count, simplify
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import ProgressSink, Stages

_MORE = "request more, or use a wider `close` or fewer `components`"
_MOST_FACES_SUMMED = 2e8  # for winding numbers in all rooms


def remesh(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: ProgressSink | None = None,
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
        Called with each stage.
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
    mesh, options, stages = as_mesh(mesh), options or RemeshOptions(), Stages(progress)
    return _remeshed(mesh, options, stages, threads, counts_cavities=False)[0]


def looks_open(mesh: Mesh, *, threads: int | None = None) -> bool:
    """Tell whether `remesh` keeps a mesh open.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere, plane
    >>> looks_open(plane()), looks_open(icosphere(2))
    (True, False)
    """
    points = Grid.around(mesh, RemeshOptions()).to_voxels(mesh.positions)
    return kind_of(points, mesh.faces, threads=threads).is_open


def remesh_with_thinness(
    mesh: Mesh, options: RemeshOptions, *, threads: int | None = None
) -> tuple[Mesh, float, float]:
    """Wrap a mesh without filling holes; also return a voxel's side, and `thin_share`."""
    wrapped, grid, counts = _remeshed(
        mesh, options, Stages(None), threads, counts_cavities=False, fills_holes=False
    )
    return wrapped, grid.voxel, counts.thin_share


def remesh_with_report(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> tuple[Mesh, RemeshReport]:
    """Remesh a mesh, and report how far the result lies from it."""
    mesh, options, stages = as_mesh(mesh), options or RemeshOptions(), Stages(progress)
    start = time.perf_counter()
    wrapped, grid, counts = _remeshed(mesh, options, stages, threads, counts_cavities=True)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = surface_distance(wrapped, mesh, threads=threads).a_to_b
    report = RemeshReport(
        n_faces_before=mesh.n_faces,
        n_faces=wrapped.n_faces,
        n_vertices=wrapped.n_vertices,
        n_components=counts.n_components,
        n_dropped=counts.n_dropped,
        n_crumbs=counts.n_crumbs,
        n_cut_off=counts.n_cut_off,
        n_cavities_kept=counts.n_cavities,
        n_cavities_filled=0 if options.keep_interior else counts.rooms.n_cavities,
        n_rooms_untested=counts.rooms.n_untested,
        voxel=grid.voxel,
        gap=grid.gap * grid.voxel,
        surface=OPEN if counts.kind.is_open else CLOSED,
        reason=counts.kind.reason,
        n_holes_filled=counts.n_holes_filled,
        n_boundaries=counts.n_boundaries,
        n_handles_made=counts.n_handles_made,
        area_ratio=counts.area_ratio,
        thin_share=counts.thin_share,
        distance=distance,
        diagonal=mesh.diagonal,
        seconds=seconds,
    )
    return wrapped, report


_NO_ROOMS = Rooms(n_cavities=0, n_untested=0)


@dataclass(frozen=True, kw_only=True)
class _Counts:
    """Figures for `RemeshReport`."""

    n_components: int
    n_dropped: int
    n_crumbs: int
    n_cut_off: int = 0
    n_cavities: int = 0
    rooms: Rooms = _NO_ROOMS
    thin_share: float = 0.0
    kind: Kind = AS_IT_IS
    n_holes_filled: int = 0
    n_handles: int = 0
    n_boundaries: int = 0
    n_handles_made: int = 0
    area_ratio: float = 1.0


def _remeshed(
    mesh: Mesh,
    options: RemeshOptions,
    stages: Stages,
    threads: int | None,
    *,
    counts_cavities: bool,
    fills_holes: bool = True,
) -> tuple[Mesh, Grid, _Counts]:
    grid = Grid.around(mesh, options)
    points = grid.to_voxels(mesh.positions)
    kind, filled, n_parts, whole = AS_IT_IS, _unfilled(mesh), mesh.n_faces, None
    if fills_holes:
        with stages.stage("find boundary"):
            kind, filled = _filled(mesh, points, grid.gap, options, threads)
            n_parts = face_components(kind.faces, mesh.n_vertices)[1]
        if n_parts == 1:
            whole = filled.faces if filled.n_holes else kind.faces
    try:
        if kind.is_open:
            moved, faces, counts = _sheet(points, filled, grid, options, stages, threads)
        else:
            moved, faces, counts = _wrap(
                points,
                mesh.faces,
                filled,
                grid,
                options,
                stages,
                threads,
                counts_cavities=counts_cavities,
                n_parts=n_parts,
                whole=whole,
            )
    except CrowdedGridError as error:
        raise too_crowded(mesh, options, error) from error
    except NoSheetError as error:
        raise MeshError(
            f"{mesh.name}: its sheets are smaller than the voxels; use a greater `resolution`"
        ) from error
    n_filled = filled.n_holes
    if kind.is_open and counts.n_dropped == 0:  # some holes are narrower than the voxels
        n_parts_gone = n_parts - counts.n_components
        n_filled = max(n_filled, len(kind.loops.sizes) - counts.n_boundaries - n_parts_gone)
    counts = replace(counts, kind=kind, n_holes_filled=n_filled)
    if fills_holes:
        n_made = require_topology(
            mesh.name,
            kind,
            n_parts,
            counts.n_components,
            counts.n_handles,
            counts.n_boundaries,
            may_be_pierced=filled.n_holes > 0 or counts.thin_share > PIERCED,
        )
        counts = replace(counts, n_handles_made=n_made)
    if kind.is_open:
        areas = [
            float(face_areas(*one, threads=threads).sum())
            for one in ((moved, faces), (points, filled.faces))
        ]
        counts = replace(counts, area_ratio=areas[0] / areas[1])
    wrapped = Mesh(positions=grid.to_model(moved), faces=faces, name=mesh.name)
    if options.sharp_edges:
        wrapped = with_normals(wrapped, "angle", angle=SHARP_ANGLE)
    if options.n_faces is not None:
        wrapped = simplify(wrapped, options.n_faces, quality=options.quality, threads=threads)
        check_count(wrapped.n_faces, options.n_faces, mesh.name, _MORE)
    return with_nearest_attributes(wrapped, mesh, threads), grid, counts


def _unfilled(mesh: Mesh) -> Filled:
    return Filled(mesh.faces, None, mesh.n_faces, 0, NO_LOOPS.edges)


def _filled(
    mesh: Mesh, points: FloatArray, gap: float, options: RemeshOptions, threads: int | None
) -> tuple[Kind, Filled]:
    """Choose between an open surface and a body, and fill holes accordingly."""
    kind = kind_of(points, mesh.faces, threads=threads)
    if options.surface != AUTO:
        kind = replace(kind, is_open=options.surface == OPEN, reason="as requested")
    elif options.keep_interior and kind.is_open:
        kind = replace(kind, is_open=False, reason="its interior is kept")
    if kind.is_open and kind.is_one_sided:
        raise MeshError(f"{mesh.name}: its sheets have one side only; use `surface={CLOSED}`")
    filled = fill_holes(points, kind, gap, whole=options.surface == CLOSED)
    return kind, filled if kind.is_open or filled.n_holes else _unfilled(mesh)


def _wrap(
    points: FloatArray,
    given: IntArray,
    filled: Filled,
    grid: Grid,
    options: RemeshOptions,
    stages: Stages,
    threads: int | None,
    *,
    counts_cavities: bool,
    n_parts: int,
    whole: IntArray | None,
) -> tuple[FloatArray, IntArray, _Counts]:
    """Wrap a body of some separate parts in a closed surface, or one `whole` part."""

    def measure_windings(of_rooms: FloatArray) -> FloatArray:
        # Of a soup of triangles, which has rooms by the ten thousand, only the largest are tested.
        return winding_numbers(
            points, given, of_rooms, most_work=_MOST_FACES_SUMMED, threads=threads
        )

    with stages.stage("measure voxels"):
        band = Band.around(points, filled.faces, grid.shape, threads=threads)
        labels = band.labels(threads=threads)
    with stages.stage("find outside"):
        rooms = flood_outside(
            labels,
            grid.gap / 2.0 - SHELL_DEPTH,
            measure_windings if counts_cavities or options.keep_interior else None,
            keep_cavities=options.keep_interior,
            threads=threads,
        )
    with stages.stage("build surface"):
        nets = build_body(band, labels, points, filled, whole, threads=threads)
    del band, labels
    with stages.stage("project"):
        tree = TriangleTree.build(points, filled.faces, threads=threads)
        moved, faces = project(
            nets, tree, sharp_edges=options.sharp_edges, smooth=filled.smooth, threads=threads
        )
    moved, faces, n_crumbs = without_crumbs(moved, faces, keep_cavities=options.keep_interior)
    moved, faces, n_cut_off = without_cut_off(moved, faces, n_parts)
    moved, faces, n_dropped = largest_parts(moved, faces, options.n_components, threads=threads)
    parts = Parts.of(moved, faces)
    counts = _Counts(
        n_components=int(np.count_nonzero(~parts.is_wall)),
        n_cavities=int(np.count_nonzero(parts.is_wall)),
        n_dropped=n_dropped,
        n_crumbs=n_crumbs,
        n_cut_off=n_cut_off,
        rooms=rooms,
        thin_share=float(np.mean(nets.thin)),
        # Every edge has two faces.
        n_handles=len(parts.volumes) - (len(moved) - len(faces) // 2) // 2,
    )
    return moved, faces, counts


def _sheet(
    points: FloatArray,
    filled: Filled,
    grid: Grid,
    options: RemeshOptions,
    stages: Stages,
    threads: int | None,
) -> tuple[FloatArray, IntArray, _Counts]:
    """Remesh an open surface as sheets."""
    with stages.stage("build sheets"):
        sharp = options.sharp_edges
        moved, faces, n_crumbs = remesh_sheets(
            points, filled, grid.shape, sharp_edges=sharp, threads=threads
        )
    moved, faces, n_dropped = largest_sheets(moved, faces, options.n_components)
    n_boundaries = len(Loops.of(moved, faces).sizes)
    counts = _Counts(
        n_components=face_components(faces, len(moved))[1],
        n_dropped=n_dropped,
        n_crumbs=n_crumbs,
        n_handles=(count_loops(faces) - n_boundaries) // 2,
        n_boundaries=n_boundaries,
    )
    return moved, faces, counts
