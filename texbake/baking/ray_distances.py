"""How far rays reach at each vertex of a low-poly mesh: as far as the high-poly surface there.

One distance for all rays is that of the worst place. On a hand it lets the rays of a finger start
inside of the next one. Here each vertex has two distances of its own, out and in, and another pair
on each side of a sharp edge. A ray interpolates those at the corners of its face.

Points of both surfaces tell how far apart they are. A point of the high-poly mesh counts for the
closest face of the low-poly mesh, if both face alike. A point of the low-poly mesh counts for its
own face, with the nearer of the surfaces that its ray meets out and in. A vertex reaches as far as
the farthest point of the faces around it and around its neighbors, and no less far than a quarter
of all vertices do.

Nothing is lost: a ray that misses, or that meets a surface from behind, is cast again as far as
the greatest distance.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.seams import merged_labels
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.objects import weld_vertices
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.mesh.topology import edge_neighbors
from texbake.mesh.triangle_tree import TriangleTree
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.records import dataclass

# Points between the measured ones may lie a little farther away.
MARGIN = 1.1
# The least distance, of the local frame's unit size, above the rounding of float32 rays (1e-7).
LEAST_EXTENT = 1e-4
# About this many triangles of the high-poly mesh are measured, at their corners.
_HIGH_TRIANGLES = 40_000
# Quantile of the distances of all vertices that is the least distance of each.
_FLOOR = 0.25
# Cosine of the angle between faces from which on an edge is sharp: 60 degrees.
_EDGE = 0.5


@dataclass(frozen=True, eq=False)
class RayProbe:
    """Hits of rays that were cast out and in from points of a low-poly mesh."""

    faces: IntArray  # (n,) int32; face of each point
    inward: Rays
    out: RayHits
    into: RayHits

    def distances(self) -> FloatArray:
        """(2, n) float64: distances out and in to a surface that faces as the mesh does."""
        # On its way out a ray meets the surface from behind, on its way in from the front.
        return np.stack(
            [
                np.where(
                    (hits.faces != NO_HIT) & (hits.passed_back == is_behind), hits.distances, np.inf
                )
                for hits, is_behind in ((self.out, True), (self.into, False))
            ]
        )


def measure_ray_distances(
    high: Mesh | StreamedMesh,
    low: Mesh,
    frame: LocalFrame,
    probe: RayProbe,
    *,
    threads: int | None = None,
) -> FloatArray:
    """(F, 3, 2) local distances that rays must reach in front of and behind each corner."""
    of_faces = np.zeros((low.n_faces, 2))
    _add_high(of_faces, high, low, frame, threads)
    _add_low(of_faces, probe)
    sides = _sides(low)
    for _ in range(2):  # the faces around a vertex, then those around its neighbors
        distances = np.zeros((int(sides.max()) + 1, 2))
        for corner in range(3):
            np.maximum.at(distances, sides[:, corner], of_faces)
        of_faces = distances[sides].max(axis=1)
    floor = np.quantile(distances, _FLOOR, axis=0)
    distances = np.maximum(distances, floor) * MARGIN + LEAST_EXTENT
    return np.asarray(distances[sides])


def _sides(low: Mesh) -> IndexArray:
    """(F, 3) side of its vertex that each corner lies on; faces below `_EDGE` share one."""
    faces = weld_vertices(low)[low.faces]
    pairs = edge_neighbors(faces)
    normals = face_normals(low)
    smooth = pm.vecdot(normals[pairs.first], normals[pairs.second]) > _EDGE
    labels = merged_labels(
        low.n_faces, pairs.first[smooth].astype(np.int32), pairs.second[smooth].astype(np.int32)
    )
    keys = faces.astype(np.int64) * low.n_faces + labels[:, np.newaxis]
    numbers: IndexArray = np.unique(keys, return_inverse=True)[1].reshape(-1, 3)
    return numbers


def _add_high(
    of_faces: FloatArray,
    high: Mesh | StreamedMesh,
    low: Mesh,
    frame: LocalFrame,
    threads: int | None,
) -> None:
    """Raise the distances of faces to those of the high-poly points that are closest to them."""
    step = max(1, high.n_faces // _HIGH_TRIANGLES)
    triangles = frame.to_local(spread_corners(high, step))
    corners = triangles.reshape(-1, 3)
    facing = np.repeat(_normals(triangles), 3, axis=0)
    positions = frame.to_local(low.positions)
    tree = TriangleTree.build(positions, low.faces, threads=threads)
    distances, faces, weights = tree.closest_points(corners, threads=threads)
    low_triangles = positions[low.faces[faces]]
    normals = _normals(low_triangles)
    offsets = corners - pm.vecmat(weights, low_triangles)
    agrees = pm.vecdot(facing, normals) > 0.0
    is_out = pm.vecdot(offsets, normals) >= 0.0
    for side, chosen in enumerate((agrees & is_out, agrees & ~is_out)):
        np.maximum.at(of_faces[:, side], faces[chosen], distances[chosen])


def spread_corners(high: Mesh | StreamedMesh, step: int) -> FloatArray:
    """(n, 3, 3) float64: corners of every so many faces."""
    if isinstance(high, StreamedMesh):
        return high.spread_corners(step).reshape(-1, 3, 3)
    return high.positions[high.faces[::step]]


def _normals(triangles: FloatArray) -> FloatArray:
    """Normals of triangles (n, 3, 3), as long as twice their areas."""
    first, second, third = np.moveaxis(triangles, 1, 0)
    return np.cross(second - first, third - first)


def _add_low(of_faces: FloatArray, probe: RayProbe) -> None:
    """Raise the distances of faces to what the rays of their points met first."""
    distances = probe.distances()
    is_out = distances[0] < distances[1]
    for side, chosen in enumerate((is_out, ~is_out & np.isfinite(distances[1]))):
        np.maximum.at(of_faces[:, side], probe.faces[chosen], distances[side][chosen])
