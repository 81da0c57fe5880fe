"""Points that a cage must enclose: those of the high-poly surface outside the low-poly mesh.

Over the inside of a cage face the farthest points of the high-poly surface are its vertices. Over
edges and vertices of the cage they need not be, so rays cast outward from the low-poly surface find
points there. A vertex lies over the point of the low-poly surface whose smooth normal goes through
it.

Kernel: `core/newton.c`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from texbake.baking.scenes import measure_extent
from texbake.core import core, portable_math as pm
from texbake.mesh.frame import LocalFrame
from texbake.mesh.half_edges import opposite_half_edges
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, Rays, Rows
from texbake.raycast.scene import RayScene

_MOST_RAYS = 1 << 20
_MOST_STEPS = 16  # of a lattice, along an edge of the low-poly mesh
# A face is folded if the cosine between its normal and the smooth normal of a corner is less than
# this: moving that corner out hardly raises the face.
_FOLDED = 0.2
_BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class OuterPoints(Rows):
    """Points of the high-poly surface outside the low-poly mesh, in the local frame.

    Attributes
    ----------
    positions : (n, 3) float64
    faces : (n,) int32
        Face of the low-poly mesh under each point; -1 for a point beside its border, over none.
    heights : (n,) float64
        Height along the interpolated smooth normal, in units of its length.
    exact : (n,) bool
        False if no normal of the low-poly surface goes through the point, as where normals cross:
        the face is then the closest one, and the height the distance to it. False also over folded
        faces, where the smooth normal of a corner hardly points out of the face.
    """

    positions: FloatArray
    faces: IntArray
    heights: FloatArray
    exact: npt.NDArray[np.bool_]


def find_outer_points(
    high: Mesh, low: Mesh, normals: FloatArray, frame: LocalFrame, *, threads: int | None
) -> OuterPoints:
    """Find the points that a cage of the low-poly mesh must enclose.

    `normals` (V, 3) float64.
    """
    positions = frame.to_local(low.positions)
    with RayScene.build(high, frame, threads=threads) as scene:
        extent = measure_extent(scene, low, "smooth", threads=threads)
        limit = float(frame.length_to_local(extent.front))
        over_lattice = _ray_points(high, positions, low.faces, normals, frame, scene, limit)
    points = OuterPoints.joined(
        [over_lattice, _vertex_points(high, positions, low.faces, normals, frame, threads)]
    )
    sides = pm.matvec(normals[low.faces], face_normals(low, threads=threads))
    folded = np.any(sides < _FOLDED, axis=1)
    return replace(points, exact=points.exact & ~folded[points.faces])


def _ray_points(
    high: Mesh,
    positions: FloatArray,
    faces: IntArray,
    normals: FloatArray,
    frame: LocalFrame,
    scene: RayScene,
    limit: float,
) -> OuterPoints:
    """Points where rays, cast outward from a lattice on each face, leave the high-poly mesh."""
    weights = _lattice(len(faces))
    owners = np.repeat(np.arange(len(faces), dtype=np.int32), len(weights))
    at = np.tile(weights, (len(faces), 1))
    origins = pm.vecmat(at, positions[faces[owners]])
    outward = pm.vecmat(at, normals[faces[owners]])
    lengths = np.sqrt(pm.vecdot(outward, outward))
    outward /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    ends = np.where(lengths > 0.0, limit, 0.0)
    hits = scene.cast(Rays(origins, outward, ends, np.zeros(len(owners))), cull_back_faces=False)
    hit = np.flatnonzero(hits.faces != NO_HIT)
    corners = frame.to_local(high.positions[high.faces[hits.faces[hit]]])
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


def _vertex_points(
    high: Mesh,
    positions: FloatArray,
    faces: IntArray,
    normals: FloatArray,
    frame: LocalFrame,
    threads: int | None,
) -> OuterPoints:
    """Vertices of the high-poly mesh outside the low-poly one, with the face under each."""
    points = frame.to_local(high.positions[np.unique(high.faces)])
    tree = TriangleTree.build(positions, faces, threads=threads)
    distances, closest, weights = tree.closest_points(points, threads=threads)
    opposite = opposite_half_edges(faces, solid=np.ones(len(faces), dtype=np.bool_))
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
