"""Fitting a cage: each vertex as close to the low-poly mesh as the high-poly surface allows.

All vertices start as far out as the highest point over any of their faces, so that everything lies
inside. Then they move in, halfway at a time, until a point would come through one of their faces.

Over the inside of a cage face the farthest points of the high-poly surface are its vertices; over
its edges, rays cast outward from the low-poly surface find points. A vertex lies over the point of
the low-poly surface whose smooth normal goes through it. Kernel: `core/cage.c`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.baking.ray_distances import LEAST_EXTENT
from texbake.baking.scenes import measure_extent
from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, counted
from texbake.mesh.frame import LocalFrame, UnitGrid
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals, smooth_normals
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, Rays, Rows
from texbake.raycast.scene import RayScene
from texbake.records import dataclass

_SWEEPS = 60


@dataclass(frozen=True, eq=False)
class Cage:
    """A cage and how well it fits."""

    mesh: Mesh  # faces and texture coordinates of the low-poly mesh, with the positions of the cage
    # (V,) float64: how far each vertex was moved along its smooth normal, in model units
    distances: FloatArray
    # points of the high-poly surface outside the low-poly mesh that the cage was fitted to
    n_points: int
    # points beside the border of an open low-poly mesh, which no cage of it can enclose
    n_beside: int
    # points over folds of the low-poly mesh: the corners there move out as far as the points, but
    # the points may still come through
    n_uncertain: int
    # how far the farthest of the other points lies outside the cage, in model units; 0 if all are
    # inside
    greatest_outside: float
    # vertices that stay in place: no face around them has an area, so they have no normal
    n_still: int = 0

    @property
    def warnings(self) -> list[str]:
        """Parts of the high-poly surface that the cage does not enclose, one sentence each."""
        lines = []
        if self.greatest_outside > 0.0:
            lines.append(
                f"{self.mesh.name}: the high-poly surface comes out of it by up to "
                f"{self.greatest_outside:.3g}, where the low-poly mesh is folded; repair it there, "
                "or give a `margin`"
            )
        if self.n_beside:
            lines.append(
                f"{self.mesh.name}: {counted(self.n_beside, 'point lies', 'points lie')} beside "
                "the border of the low-poly mesh, where it has no cage; extend the low-poly mesh "
                "to bake them"
            )
        if self.n_still:
            lines.append(
                f"{self.mesh.name}: {self.n_still:,} of its vertices stay in place, because "
                "no face around them has an area; repair the low-poly mesh there"
            )
        return lines

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        rows = [
            ("vertices", f"{len(self.distances):,}"),
            (
                "moved by",
                f"{np.median(self.distances):.4g} (median), {self.distances.min():.4g} to "
                f"{self.distances.max():.4g}",
            ),
            ("fitted to", f"{self.n_points:,} points of the high-poly mesh"),
        ]
        if self.n_uncertain:
            rows.append(
                ("over folds", counted(self.n_uncertain, "point") + ", which may come through")
            )
        return rows


def fit_cage(
    high: MeshLike, low: MeshLike, *, margin: float | None = None, threads: int | None = None
) -> Cage:
    """Fit a cage: the low-poly mesh inflated just enough to enclose the high-poly mesh.

    No part of the high-poly surface lies outside the cage, and no vertex could move farther in on
    its own without letting some of it through. Vertices move along smooth normals, those at one
    position together, so that the cage has no gaps. `Cage.warnings` names the exceptions: folds and
    open borders of the low-poly mesh.

    Parameters
    ----------
    high, low
        The meshes of a bake; the low-poly mesh needs no texture coordinates.
    margin
        Distance in model units that is added everywhere. None for 1e-4 of the size of both meshes,
        which is above the rounding of float32 rays.
    threads
        None for one per core.

    Returns
    -------
    Cage
        The same, byte for byte, for any number of threads.

    Raises
    ------
    OptionError
        The margin is below 0 or not finite.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> fit_cage(plane(), plane(), margin=0.5).distances.tolist()
    [0.5, 0.5, 0.5, 0.5]
    """
    high, low = as_mesh(high), as_mesh(low)
    if margin is not None and not 0.0 <= margin < np.inf:
        raise OptionError(f"margin: {margin} is not a distance; give 0 or more")
    grid = UnitGrid.around(high, low)
    snapped = low.replace(positions=grid.to_grid(low.positions))
    firsts = weld_rows(low.positions)
    welded = snapped.replace(faces=firsts[low.faces], tangents=None)
    fitted = smooth_normals(snapped)
    snapped_high = high.replace(positions=grid.to_grid(high.positions))
    points = find_outer_points(snapped_high, welded, fitted, threads=threads)
    held = points.where(points.faces >= 0)
    distances, outside = _fitted_distances(welded.positions, welded.faces, fitted, held)
    added = LEAST_EXTENT if margin is None else float(grid.length_to_grid(margin))
    moved = grid.length_to_model(distances[firsts] + added)
    normals = smooth_normals(low)
    has_normal = (normals != 0.0).any(axis=1)
    moved = np.where(has_normal, moved, 0.0)
    mesh = low.replace(
        positions=low.positions + moved[:, None] * normals,
        normals=None,
        normal_faces=None,
        tangents=None,
        name=f"cage of {low.name}",
    )
    left = max(float(grid.length_to_model(outside - added)), 0.0)
    n_uncertain = int(np.count_nonzero(~held.exact))
    n_still = len(np.unique(low.faces[~has_normal[low.faces]]))
    return Cage(mesh, moved, len(held), len(points) - len(held), n_uncertain, left, n_still)


def _fitted_distances(
    positions: FloatArray, faces: IntArray, normals: FloatArray, points: OuterPoints
) -> tuple[FloatArray, float]:
    """Distance of each vertex, and how far the farthest point lies outside, in local units."""
    starts = np.zeros(len(positions))
    for corner in range(3):
        np.maximum.at(starts, faces[points.faces, corner], points.heights)
    floors = np.zeros(len(positions))
    uncertain = points.where(~points.exact)
    for corner in range(3):
        np.maximum.at(floors, faces[uncertain.faces, corner], uncertain.heights)
    exact = points.where(points.exact)
    by_face = np.argsort(exact.faces, kind="stable")
    first_points = np.searchsorted(exact.faces[by_face], np.arange(len(faces) + 1))
    order = np.argsort(faces.ravel(), kind="stable")
    first_corners = np.searchsorted(faces.ravel()[order], np.arange(len(positions) + 1))
    distances = starts.copy()
    outside = core.fit_cage(
        positions, faces, normals, exact.positions[by_face], first_points, order, first_corners,
        floors, 2.0 * starts, _SWEEPS, distances,
    )  # fmt: skip
    return distances, float(outside)


_MOST_RAYS = 1 << 20
_MOST_STEPS = 16  # of a lattice, along an edge of the low-poly mesh
# A face is folded if the cosine between its normal and the smooth normal of a corner is less than
# this: moving that corner out hardly raises the face.
_FOLDED = 0.2
_BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class OuterPoints(Rows):
    """Points of the high-poly surface outside the low-poly mesh, on the grid of both."""

    positions: FloatArray  # (n, 3) float64
    # (n,) int32; face of the low-poly mesh under each point; -1 for a point beside its border, over
    # none.
    faces: IntArray
    # (n,) float64; height along the interpolated smooth normal, in units of its length.
    heights: FloatArray
    # False if no normal of the low-poly surface goes through the point, as where normals cross: the
    # face is then the closest one, and the height the distance to it. False also over folded faces,
    # where the smooth normal of a corner hardly points out of the face.
    exact: BoolArray


def find_outer_points(
    high: Mesh, low: Mesh, normals: FloatArray, *, threads: int | None
) -> OuterPoints:
    """Points that a cage must enclose, on the grid of both meshes; normals (V, 3) are smooth."""
    over_lattice = _ray_points(high, low, normals, threads)
    points = OuterPoints.joined([over_lattice, _vertex_points(high, low, normals, threads)])
    sides = pm.matvec(normals[low.faces], face_normals(low, threads=threads))
    folded = np.any(sides < _FOLDED, axis=1)
    return replace(points, exact=points.exact & ~folded[points.faces])


def _ray_points(high: Mesh, low: Mesh, normals: FloatArray, threads: int | None) -> OuterPoints:
    """Points where rays, cast outward from a lattice on each face, leave the high-poly mesh."""
    scene = RayScene.build(high, LocalFrame(np.zeros(3), 1.0), threads=threads)
    limit = measure_extent(scene, low, "smooth").front
    faces, weights = low.faces, _lattice(low.n_faces)
    owners = np.repeat(np.arange(len(faces), dtype=np.int32), len(weights))
    at = np.tile(weights, (len(faces), 1))
    origins = pm.vecmat(at, low.positions[faces[owners]])
    outward = pm.vecmat(at, normals[faces[owners]])
    lengths = np.sqrt(pm.vecdot(outward, outward))
    outward /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    ends = np.where(lengths > 0.0, limit, 0.0)
    hits = scene.cast(Rays(origins, outward, ends, np.zeros(len(owners))), cull_back_faces=False)
    hit = np.flatnonzero(hits.faces != NO_HIT)
    corners = high.positions[high.faces[hits.faces[hit]]]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A ray that hits a front face starts outside the high-poly mesh and meets another part of it.
    hit = hit[pm.vecdot(facing, outward[hit]) > 0.0]
    distances = hits.distances[hit]
    # Where the normals at the corners nearly cancel, no distance along them is meaningful.
    exact = lengths[hit] >= _FOLDED
    return OuterPoints(
        origins[hit] + distances[:, None] * outward[hit],
        owners[hit],
        distances / np.where(exact, lengths[hit], 1.0),
        exact,
    )


def _lattice(n_faces: int) -> FloatArray:
    """(n, 3) barycentrics, corners and edges included, as many as `_MOST_RAYS` allows."""
    steps = _MOST_STEPS
    while steps > 1 and n_faces * (steps + 1) * (steps + 2) // 2 > _MOST_RAYS:
        steps -= 1
    indices = [(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)]
    second, third = np.array(indices, dtype=np.float64).T / steps
    return np.stack([1.0 - second - third, second, third], axis=1)


def _vertex_points(high: Mesh, low: Mesh, normals: FloatArray, threads: int | None) -> OuterPoints:
    """Vertices of the high-poly mesh outside the low-poly one, with the face under each."""
    positions, faces = low.positions, low.faces
    points = high.positions[np.unique(high.faces)]
    tree = TriangleTree.build(positions, faces, threads=threads)
    distances, closest, weights = tree.closest_points(points, threads=threads)
    opposite = opposite_half_edges(faces)
    owners = np.empty(len(points), dtype=np.int32)
    heights = np.empty(len(points))
    exact = np.empty(len(points), dtype=np.bool_)

    def find_faces(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.find_faces_under(
            points[band], distances[band], closest[band], weights[band],
            positions, faces, normals, opposite, owners[band], heights[band], exact[band],
        )  # fmt: skip

    run_bands(find_faces, len(points), band=_BAND, threads=threads)
    return OuterPoints(points, owners, heights, exact).where(heights > 0.0)
