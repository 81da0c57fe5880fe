"""What a cage must hold: points of the dense surface outside the light one, and where they lie.

Over a flat face of the cage the farthest points of a dense surface of flat triangles are its
vertices; over the cage's edges and vertices they are not, so rays from the light surface outward
find those. A vertex lies over the point of the light surface whose smooth normal goes through it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from texbake.baking.scenes import measure_extent
from texbake.kernels import kernel
from texbake.mapping.seams import opposite_half_edges
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, Rays, Rows
from texbake.raycast.scene import RayScene

_MOST_RAYS = 1 << 20
_MOST_STEPS = 16  # of a lattice along an edge of the light mesh
# Cosine of the angle between a face and a corner's smooth normal under which the face is folded:
# moved out, that corner carries no side of it any more.
_FOLDED = 0.2
_BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class OuterPoints(Rows):
    """Points of the dense surface outside the light one, in the local frame.

    Attributes
    ----------
    positions : (n, 3) float64
    faces : (n,) int32
        Face of the light mesh that each lies over; -1 where it lies over none, beside its border.
    heights : (n,) float64
        Along the smooth normal, in units of that normal as it is interpolated.
    exact : (n,) bool
        False where no normal of the light surface goes through the point, as where they cross: the
        face is the closest one then, and the height the distance to it. False also over a face
        that a normal of its corners hardly leaves or goes back into.
    """

    positions: FloatArray
    faces: IntArray
    heights: FloatArray
    exact: npt.NDArray[np.bool_]


def outer_points(
    high: Mesh, low: Mesh, normals: FloatArray, frame: LocalFrame, *, threads: int | None
) -> OuterPoints:
    """Find what a cage of the light mesh must hold.

    Parameters
    ----------
    normals : (V, 3) float64
        Smooth normals of the light mesh.
    """
    positions = frame.to_local(low.positions)
    with RayScene.build(high, frame, threads=threads) as scene:
        extent = measure_extent(scene, low, "smooth", threads=threads)
        limit = float(frame.length_to_local(extent.front))
        over_lattice = _along_rays(high, positions, low.faces, normals, frame, scene, limit)
    points = OuterPoints.joined(
        [over_lattice, _over_vertices(high, positions, low.faces, normals, frame, threads)]
    )
    sides = np.einsum("fkx,fx->fk", normals[low.faces], face_normals(low, threads=threads))
    folded = (sides < _FOLDED).any(axis=1)
    return replace(points, exact=points.exact & ~folded[points.faces])


def _along_rays(
    high: Mesh,
    positions: FloatArray,
    faces: IntArray,
    normals: FloatArray,
    frame: LocalFrame,
    scene: RayScene,
    limit: float,
) -> OuterPoints:
    """Where rays from a lattice on each light face, outward, leave the dense mesh."""
    weights = _lattice(len(faces))
    owners = np.repeat(np.arange(len(faces), dtype=np.int32), len(weights))
    at = np.tile(weights, (len(faces), 1))
    origins = np.einsum("nk,nkx->nx", at, positions[faces[owners]])
    outward = np.einsum("nk,nkx->nx", at, normals[faces[owners]])
    lengths = np.sqrt(np.einsum("nx,nx->n", outward, outward))
    outward /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    ends = np.where(lengths > 0.0, limit, 0.0)
    found = scene.cast(Rays(origins, outward, ends, np.zeros(len(owners))), cull_back_faces=False)
    hit = np.flatnonzero(found.faces != NO_HIT)
    corners = high.positions[high.faces[found.faces[hit]]]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A ray that meets a front first stands outside the dense mesh: what it meets is another part.
    hit = hit[np.einsum("nx,nx->n", facing, outward[hit]) > 0.0]
    reached = found.distances[hit]
    return OuterPoints(
        origins[hit] + reached[:, None] * outward[hit],
        owners[hit],
        reached / lengths[hit],
        np.ones(len(hit), dtype=np.bool_),
    )


def _lattice(n_faces: int) -> FloatArray:
    """(n, 3) barycentrics, corners and edges among them, as many as `_MOST_RAYS` allows."""
    steps = _MOST_STEPS
    while steps > 1 and n_faces * (steps + 1) * (steps + 2) // 2 > _MOST_RAYS:
        steps -= 1
    places = [(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)]
    second, third = np.array(places, dtype=np.float64).T / steps
    return np.stack([1.0 - second - third, second, third], axis=1)


def _over_vertices(
    high: Mesh,
    positions: FloatArray,
    faces: IntArray,
    normals: FloatArray,
    frame: LocalFrame,
    threads: int | None,
) -> OuterPoints:
    """Vertices of the dense mesh outside the light one, with the face that each lies over."""
    points = frame.to_local(high.positions[np.unique(high.faces)])
    tree = TriangleTree.build(positions, faces, threads=threads)
    distances, closest, weights = tree.closest_points(points, threads=threads)
    opposite = opposite_half_edges(faces, solid=np.ones(len(faces), dtype=np.bool_))
    owners = np.empty(len(points), dtype=np.int32)
    heights = np.empty(len(points))
    exact = np.empty(len(points), dtype=np.bool_)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _over_kernel(
            (points[band], distances[band], closest[band], weights[band]),
            (positions, faces, normals, opposite),
            (owners[band], heights[band], exact[band]),
        )

    run_bands(work, len(points), band=_BAND, threads=threads)
    return OuterPoints(points, owners, heights, exact).where(heights > 0.0)


@kernel
def _over_kernel(points, light, found):  # type: ignore[no-untyped-def]
    """Newton's method for position + height * normal = point, from face to face."""
    targets, distances, closest, weights = points
    positions, faces, normals, opposite = light
    owners, heights, exact = found
    step = np.empty(3)
    for i in range(len(targets)):
        face = closest[i]
        b, c = weights[i, 1], weights[i, 2]
        height, beside, solved = 0.0, False, False
        for _ in range(8):
            height = _height_kernel(targets[i], face, b, c, positions, faces, normals)
            solved = False
            for _ in range(12):
                size = _newton_kernel(
                    targets[i], face, b, c, height, positions, faces, normals, step
                )
                if not size < 1e3:
                    break
                b, c, height = b + step[0], c + step[1], height + step[2]
                if size < 1e-12:
                    solved = True
                    break
            if not solved or (b >= -1e-9 and c >= -1e-9 and b + c <= 1.0 + 1e-9):
                break
            least = min(b, c, 1.0 - b - c)
            corner = 2 if least == b else (0 if least == c else 1)
            across = opposite[3 * face + corner]
            solved = False
            if across < 0:
                beside = True
                break
            face = across // 3
            b = c = 1.0 / 3.0
        if solved:
            owners[i], heights[i], exact[i] = face, height, True
        else:
            face = closest[i]
            outside = _height_kernel(
                targets[i], face, weights[i, 1], weights[i, 2], positions, faces, normals
            )
            owners[i] = -1 if beside else face
            heights[i] = distances[i] if outside > 0.0 else 0.0
            exact[i] = False


@kernel
def _height_kernel(target, face, b, c, positions, faces, normals):  # type: ignore[no-untyped-def]
    """Height of a point over a point of a face, along the normal there."""
    height, square = 0.0, 0.0
    i, j, k = faces[face]
    for axis in range(3):
        point = (1.0 - b - c) * positions[i, axis] + b * positions[j, axis] + c * positions[k, axis]
        normal = (1.0 - b - c) * normals[i, axis] + b * normals[j, axis] + c * normals[k, axis]
        height += normal * (target[axis] - point)
        square += normal * normal
    return height / square if square > 0.0 else 0.0


@kernel
def _newton_kernel(target, face, b, c, height, positions, faces, normals, step):  # type: ignore[no-untyped-def]
    """One step of (b, c, height) by Cramer's rule; its greatest part, inf where there is none."""
    i, j, k = faces[face]
    along = np.empty((3, 3))
    rest = np.empty(3)
    for axis in range(3):
        normal = (1.0 - b - c) * normals[i, axis] + b * normals[j, axis] + c * normals[k, axis]
        point = (1.0 - b - c) * positions[i, axis] + b * positions[j, axis] + c * positions[k, axis]
        along[0, axis] = positions[j, axis] - positions[i, axis]
        along[0, axis] += height * (normals[j, axis] - normals[i, axis])
        along[1, axis] = positions[k, axis] - positions[i, axis]
        along[1, axis] += height * (normals[k, axis] - normals[i, axis])
        along[2, axis] = normal
        rest[axis] = target[axis] - point - height * normal
    volume = _triple_kernel(along[0], along[1], along[2])
    if volume == 0.0:
        return np.inf
    step[0] = _triple_kernel(rest, along[1], along[2]) / volume
    step[1] = _triple_kernel(along[0], rest, along[2]) / volume
    step[2] = _triple_kernel(along[0], along[1], rest) / volume
    return max(abs(step[0]), abs(step[1]), abs(step[2]))


@kernel
def _triple_kernel(a, b, c):  # type: ignore[no-untyped-def]
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
