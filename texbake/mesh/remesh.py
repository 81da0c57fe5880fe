"""Any triangles to a closed, manifold surface around what can be seen of them from outside.

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
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.distance import OneSidedDistance, surface_distance
from texbake.mesh.frame import LocalFrame, snapped
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.remesh_options import MIN_RESOLUTION, RemeshOptions
from texbake.mesh.remeshing.band import BLOCK_SIDE, SHELL_DEPTH, Band, CrowdedGridError
from texbake.mesh.remeshing.flood import MAX_RADIUS, Rooms, flood_outside
from texbake.mesh.remeshing.nets import build_nets
from texbake.mesh.remeshing.parts import Parts, largest_parts, without_crumbs
from texbake.mesh.remeshing.projection import project
from texbake.mesh.remeshing.sharp_edges import SHARP_ANGLE
from texbake.mesh.remeshing.winding import winding_numbers
from texbake.mesh.simplify import simplify
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import ProgressSink, Stages

# Voxels between the mesh and the border of the grid, besides the radius of the ball: the width of
# the band, and a point that is outside in any case.
_MARGIN = 4
_MOST_FACES_SUMMED = 2e8  # for winding numbers in all rooms


@dataclass(frozen=True, kw_only=True)
class RemeshReport:
    """Figures of a run of `remesh`.

    Attributes
    ----------
    n_faces_before, n_faces, n_vertices : int
        Faces of the given mesh, and of the result.
    n_components, n_dropped : int
        Separate parts of the result, and those that `components` left out.
    n_crumbs : int
        Separate parts smaller than a voxel, which are left out.
    n_cavities_kept, n_cavities_filled : int
        Walls of cavities in the result; closed rooms of several voxels in the solid, wider than the
        gaps that are closed.
    n_rooms_untested : int
        Such rooms that were too small and too many to test whether they are cavities. They count as
        solid.
    voxel : float
        Side of a voxel, in model units.
    gap : float
        Gaps up to this width are closed, in model units.
    thin_share : float
        Share of the wrap's vertices, before it is simplified, that lie around sheets.
    distance : OneSidedDistance
        From the result to the given mesh. It includes the surfaces that close gaps.
    diagonal : float
        Of the given mesh.
    seconds : float
        Without measuring the distance.
    """

    n_faces_before: int
    n_faces: int
    n_vertices: int
    n_components: int
    n_dropped: int
    n_crumbs: int
    n_cavities_kept: int
    n_cavities_filled: int
    n_rooms_untested: int
    voxel: float
    gap: float
    thin_share: float
    distance: OneSidedDistance
    diagonal: float
    seconds: float

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        notes = []
        if self.n_crumbs:
            notes.append(
                f"separate parts smaller than a voxel are left out: {self.n_crumbs:,}; a greater "
                "`resolution` keeps more"
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
        return (*notes, *self.distance.notes)

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        return asdict(self)


def remesh(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> Mesh:
    """Wrap a mesh in a closed surface.

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
        Closed, manifold and facing outwards, or into the cavities that are kept, with the groups
        and colors of the nearest points of the given mesh. It has no texture coordinates and no
        normals of its own.

    Raises
    ------
    OptionError
        The gaps to close are too wide for the resolution.
    MeshError
        The mesh has no extent, or its triangles fill the grid many times over.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> from texbake.mesh.topology import find_edges
    >>> find_edges(remesh(plane(), RemeshOptions(resolution=16)).faces).closed
    True
    """
    mesh, options, stages = as_mesh(mesh), options or RemeshOptions(), Stages(progress)
    return _remeshed(mesh, options, stages, threads, counts_cavities=False)[0]


def remesh_with_thinness(
    mesh: Mesh, options: RemeshOptions, *, threads: int | None = None
) -> tuple[Mesh, float, float]:
    """Wrap a mesh; also return the side of a voxel, and the share of the wrap on thin sheets."""
    wrapped, grid, counts = _remeshed(mesh, options, Stages(None), threads, counts_cavities=False)
    return wrapped, grid.voxel, counts.thin_share


def remesh_with_report(
    mesh: MeshLike,
    options: RemeshOptions | None = None,
    *,
    progress: ProgressSink | None = None,
    threads: int | None = None,
) -> tuple[Mesh, RemeshReport]:
    """Wrap a mesh in a closed surface, and report how far that lies from the mesh."""
    mesh, options, stages = as_mesh(mesh), options or RemeshOptions(), Stages(progress)
    start = time.perf_counter()
    wrapped, grid, counts = _remeshed(mesh, options, stages, threads, counts_cavities=True)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = surface_distance(wrapped, mesh, threads=threads).a_to_b
    parts = Parts.of(grid.to_voxels(wrapped.positions), wrapped.faces)
    report = RemeshReport(
        n_faces_before=mesh.n_faces,
        n_faces=wrapped.n_faces,
        n_vertices=wrapped.n_vertices,
        n_components=int(np.count_nonzero(~parts.is_wall)),
        n_dropped=counts.n_dropped,
        n_crumbs=counts.n_crumbs,
        n_cavities_kept=int(np.count_nonzero(parts.is_wall)),
        n_cavities_filled=0 if options.keep_interior else counts.rooms.n_cavities,
        n_rooms_untested=counts.rooms.n_untested,
        voxel=grid.voxel,
        gap=grid.gap * grid.voxel,
        thin_share=counts.thin_share,
        distance=distance,
        diagonal=mesh.diagonal,
        seconds=seconds,
    )
    return wrapped, report


# Points are on a grid with as many cells per voxel, which rounding in the model's coordinates does
# not affect.
_CELLS = 2.0**24


@dataclass(frozen=True, eq=False)
class _Grid:
    """Where the voxels are, and how many: `voxels = (local - low) / side`."""

    frame: LocalFrame
    low: FloatArray
    side: float
    gap: float  # in voxels
    shape: tuple[int, int, int]  # blocks along each axis

    @classmethod
    def around(cls, mesh: Mesh, options: RemeshOptions) -> _Grid:
        frame = LocalFrame.around(mesh)
        low, high = frame.to_local(mesh.bounds)
        if not (high - low).max() > 0.0:
            raise MeshError(f"{mesh.name}: all of its corners are at one point; nothing to wrap")
        side = float((high - low).max()) / options.resolution
        gap = options.gap(float(pm.norm(high - low)) / float(frame.scale)) * frame.scale
        gap = max(float(snapped(gap / side, _CELLS)), 2.0 * SHELL_DEPTH)
        if gap > 2.0 * MAX_RADIUS:
            raise OptionError(
                f"close: {options.close} is wider than {2 * MAX_RADIUS} voxels; "
                "close less, or lower `resolution`"
            )
        margin = int(gap / 2.0) + _MARGIN
        n_points = np.ceil(snapped((high - low) / side, _CELLS)).astype(np.int64) + 1 + 2 * margin
        nx, ny, nz = (-(-n_points // BLOCK_SIDE)).tolist()
        return cls(frame, low - margin * side, side, gap, (nx, ny, nz))

    @property
    def voxel(self) -> float:
        """Side of a voxel in model units."""
        return float(self.frame.length_to_model(self.side))

    def to_voxels(self, positions: FloatArray) -> FloatArray:
        return snapped((self.frame.to_local(positions) - self.low) / self.side, _CELLS)

    def to_model(self, positions: FloatArray) -> FloatArray:
        return self.frame.to_model(positions * self.side + self.low)


@dataclass(frozen=True, kw_only=True)
class _Counts:
    """Figures of the report that only the work itself knows, as in `RemeshReport`."""

    n_dropped: int
    n_crumbs: int
    rooms: Rooms
    thin_share: float


def _too_crowded(mesh: Mesh, options: RemeshOptions, error: CrowdedGridError) -> MeshError:
    lower = int(error.share * options.resolution)
    lower_too = f"use a `resolution` of {lower}, or " if lower >= MIN_RESOLUTION else ""
    return MeshError(
        f"{mesh.name}: its triangles are so many and so large that measuring the voxels around "
        f"them would take very long; {lower_too}wrap parts of it"
    )


def _remeshed(
    mesh: Mesh,
    options: RemeshOptions,
    stages: Stages,
    threads: int | None,
    *,
    counts_cavities: bool,
) -> tuple[Mesh, _Grid, _Counts]:
    grid = _Grid.around(mesh, options)
    points = grid.to_voxels(mesh.positions)

    def measure_windings(of_rooms: FloatArray) -> FloatArray:
        # Of a soup of triangles, which has rooms by the ten thousand, only the largest are tested.
        return winding_numbers(
            points, mesh.faces, of_rooms, most_work=_MOST_FACES_SUMMED, threads=threads
        )

    with stages.stage("measure voxels"):
        try:
            band = Band.around(points, mesh.faces, grid.shape, threads=threads)
        except CrowdedGridError as error:
            raise _too_crowded(mesh, options, error) from error
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
        nets = build_nets(band, labels, threads=threads)
    del band, labels
    thin_share = float(np.mean(nets.thin))
    with stages.stage("project"):
        tree = TriangleTree.build(points, mesh.faces, threads=threads)
        moved, faces = project(nets, tree, sharp_edges=options.sharp_edges, threads=threads)
    moved, faces, n_crumbs = without_crumbs(moved, faces, keep_cavities=options.keep_interior)
    moved, faces, n_dropped = largest_parts(moved, faces, options.n_components, threads=threads)
    wrapped = Mesh(positions=grid.to_model(moved), faces=faces, name=mesh.name)
    if options.sharp_edges:
        wrapped = with_normals(wrapped, "angle", angle=SHARP_ANGLE)
    if options.n_faces is not None:
        wrapped = simplify(wrapped, options.n_faces, quality=options.quality, threads=threads)
    counts = _Counts(n_dropped=n_dropped, n_crumbs=n_crumbs, rooms=rooms, thin_share=thin_share)
    return with_nearest_attributes(wrapped, mesh, threads), grid, counts
