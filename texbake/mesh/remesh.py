"""Any triangles to a closed, manifold surface around what can be seen of them from outside.

The mesh is put into a grid of voxels. What a ball cannot reach from outside, because all gaps are
too narrow for it, is solid: inner walls vanish, overlapping parts become one, and holes are closed.
The surface of the solid is then moved onto the mesh wherever no face folds. A sheet without
thickness is wrapped on both sides.

Based on: Cédric Portaneri, Mael Rouxel-Labbé, Michael Hemmer, David Cohen-Steiner, Pierre Alliez,
"Alpha Wrapping with an Offset", ACM Transactions on Graphics 41(4), 2022 (what a ball can reach).
Departs from it in that voxels are flooded and not tetrahedra carved.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texbake.errors import MeshError, OptionError
from texbake.mesh.distance import OneSidedDistance, surface_distance
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.remesh_options import RemeshOptions
from texbake.mesh.remeshing.band import BLOCK_SIDE, SHELL_DEPTH, Band
from texbake.mesh.remeshing.flood import MAX_RADIUS, flood_outside
from texbake.mesh.remeshing.nets import build_nets
from texbake.mesh.remeshing.projection import project
from texbake.mesh.simplify import simplify
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import TriangleTree, with_nearest_attributes
from texbake.progress import ProgressSink, Stages

# Voxels between the mesh and the border of the grid, besides the radius of the ball: the width of
# the band, and a point that is outside in any case.
_MARGIN = 4


@dataclass(frozen=True, kw_only=True)
class RemeshReport:
    """Figures of a run of `remesh`.

    Attributes
    ----------
    n_faces_before, n_faces, n_vertices : int
        Faces of the given mesh, and of the result.
    n_components, n_dropped : int
        Separate parts of the result, and those that `components` left out.
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
    voxel: float
    gap: float
    thin_share: float
    distance: OneSidedDistance
    diagonal: float
    seconds: float

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        if not self.n_dropped:
            return ()
        return (f"{self.n_dropped:,} smaller separate parts were dropped; `components` keeps them",)

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
        Closed, manifold and facing outwards, with the groups and colors of the nearest points of
        the given mesh. It has no texture coordinates and no normals of its own.

    Raises
    ------
    OptionError
        The gaps to close are too wide for the resolution.
    MeshError
        The mesh has no extent.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> from texbake.mesh.topology import find_edges
    >>> find_edges(remesh(plane(), RemeshOptions(resolution=16)).faces).closed
    True
    """
    return _remeshed(as_mesh(mesh), options or RemeshOptions(), Stages(progress), threads)[0]


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
    wrapped, grid, n_dropped, thin_share = _remeshed(mesh, options, stages, threads)
    seconds = time.perf_counter() - start
    with stages.stage("measure distance"):
        distance = surface_distance(wrapped, mesh, threads=threads).a_to_b
    report = RemeshReport(
        n_faces_before=mesh.n_faces,
        n_faces=wrapped.n_faces,
        n_vertices=wrapped.n_vertices,
        n_components=face_components(wrapped.faces, wrapped.n_vertices)[1],
        n_dropped=n_dropped,
        voxel=grid.voxel,
        gap=grid.gap * grid.voxel,
        thin_share=thin_share,
        distance=distance,
        diagonal=mesh.diagonal,
        seconds=seconds,
    )
    return wrapped, report


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
        gap = options.gap(float(np.linalg.norm(high - low)) / float(frame.scale)) * frame.scale
        gap = max(float(gap) / side, 2.0 * SHELL_DEPTH)
        if gap > 2.0 * MAX_RADIUS:
            raise OptionError(
                f"close: {options.close} is wider than {2 * MAX_RADIUS} voxels; "
                "close less, or lower `resolution`"
            )
        margin = int(gap / 2.0) + _MARGIN
        n_points = np.ceil((high - low) / side).astype(np.int64) + 1 + 2 * margin
        nx, ny, nz = (-(-n_points // BLOCK_SIDE)).tolist()
        return cls(frame, low - margin * side, side, gap, (nx, ny, nz))

    @property
    def voxel(self) -> float:
        """Side of a voxel in model units."""
        return float(self.frame.length_to_model(self.side))

    def to_voxels(self, positions: FloatArray) -> FloatArray:
        return (self.frame.to_local(positions) - self.low) / self.side

    def to_model(self, positions: FloatArray) -> FloatArray:
        return self.frame.to_model(positions * self.side + self.low)


def _remeshed(
    mesh: Mesh, options: RemeshOptions, stages: Stages, threads: int | None
) -> tuple[Mesh, _Grid, int, float]:
    """The wrapped mesh, its grid, how many parts were left out, and the share of sheets."""
    grid = _Grid.around(mesh, options)
    points = grid.to_voxels(mesh.positions)
    with stages.stage("measure voxels"):
        band = Band.around(points, mesh.faces, grid.shape, threads=threads)
        labels = band.labels(threads=threads)
    with stages.stage("find outside"):
        flood_outside(labels, grid.gap / 2.0 - SHELL_DEPTH, threads=threads)
    with stages.stage("build surface"):
        nets = build_nets(band, labels, threads=threads)
    del band, labels
    thin_share = float(np.mean(nets.thin))
    with stages.stage("project"):
        tree = TriangleTree.build(points, mesh.faces, threads=threads)
        points = project(nets, tree, threads=threads)
        faces = nets.triangles(points, threads=threads)
    points, faces, n_dropped = _largest(points, faces, options.n_components)
    wrapped = Mesh(positions=grid.to_model(points), faces=faces, name=mesh.name)
    if options.n_faces is not None:
        wrapped = simplify(wrapped, options.n_faces, quality=options.quality, threads=threads)
    return with_nearest_attributes(wrapped, mesh, threads), grid, n_dropped, thin_share


def _largest(
    points: FloatArray, faces: IntArray, n_kept: int | None
) -> tuple[FloatArray, IntArray, int]:
    """Keep the parts of most volume; also return how many are left out."""
    if n_kept is None:
        return points, faces, 0
    parts, n_parts = face_components(faces, len(points))
    if n_parts <= n_kept:
        return points, faces, 0
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    volumes = np.bincount(parts, np.einsum("ij,ij->i", a, np.cross(b, c)), n_parts)
    kept = np.zeros(n_parts, dtype=np.bool_)
    kept[np.argsort(-volumes, kind="stable")[:n_kept]] = True
    used, compact = np.unique(faces[kept[parts]], return_inverse=True)
    return points[used], compact.reshape(-1, 3).astype(np.int32), n_parts - n_kept
