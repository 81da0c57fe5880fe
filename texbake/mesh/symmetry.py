"""The mirror plane of a surface, found by registering the surface to its mirror image.

Candidates are the planes through the centroid, perpendicular to the axes of the frame, to the
principal axes, and to directions in between where two moments are nearly equal. Closest points
refine each candidate: the least-squares plane between points and the surface points closest to
their mirror images.

Based on: P. Besl, N. McKay, "A method for registration of 3-D shapes", 1992 (closest points).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.distance import sample_points
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.triangle_tree import TriangleTree
from texbake.records import dataclass

# Share of the diagonal of the bounding box within which the mirror images of 19 of 20 points must
# lie from the surface, and the same as a share of the extent across the plane: a thin plate is not
# symmetric only because both its sides are near each other.
MIRROR_TOLERANCE = 0.012
_ACROSS_TOLERANCE = 0.05
_SHARE = 0.95

# Points whose images are looked for first: half of them must be within the tolerance.
_FIRST_LOOK = 75
# Points, steps of closest points, and the error, in tolerances, above which a plane is dropped.
_ROUNDS = ((150, 4, 5.0), (150, 4, 2.5), (1500, 6, 1.0))
_MOST_PLANES = 3  # that go on to the next round: a sphere has any number of them
_EXACT = 1e-7  # diagonals, the rounding of float32: further steps do not improve such a plane
_FARTHEST = 10.0  # tolerances; farther points do not count
# Share of the points, the closest ones, that the plane is fitted to: others may have no image.
_TRIMMED = 0.85
# If two moments differ by less than this share of the larger, axes between theirs are tried, too.
_MOST_ALIKE = 0.1
_N_TURNS = 8  # of those axes


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """A plane about which a surface is symmetric: points with normal · x = offset."""

    normal: FloatArray  # (3,) float64; of length 1
    offset: float
    error: float  # distance that 95 % of the mirrored points have at most, in diagonals

    def heights(self, points: FloatArray) -> FloatArray:
        """(n,) float64: signed distances of points (n, 3) from the plane."""
        return np.asarray(pm.matmul(points, self.normal) - self.offset)

    def mirrored(self, points: FloatArray) -> FloatArray:
        """(n, 3) float64: mirror images of points."""
        return np.asarray(points - 2.0 * self.heights(points)[:, None] * self.normal)


def find_mirror_plane(
    points: FloatArray, faces: IntArray, *, threads: int | None = None
) -> MirrorPlane | None:
    """Find the plane that mirrors a surface of about unit size onto itself, if any."""
    n_most = max(n for n, _, _ in _ROUNDS)
    samples = sample_points(points, faces, n_most, threads=threads)
    diagonal = float(pm.norm(np.ptp(points[faces].reshape(-1, 3), axis=0)))
    if not diagonal > 0.0:
        return None
    tree = TriangleTree.for_points(n_most, points, faces, threads=threads)
    center = samples.mean(axis=0)
    planes = [
        MirrorPlane(normal, float(pm.vecdot(normal, center)), np.inf)
        for normal in _directions(samples - center)
    ]
    few = samples[:: len(samples) // _FIRST_LOOK]
    planes = [plane for plane in planes if _is_likely(plane, tree, few, diagonal)]
    for n_samples, n_steps, most in _ROUNDS:
        few = samples[:: len(samples) // n_samples]
        refined = [_refined(plane, tree, few, n_steps, diagonal) for plane in planes]
        planes = _distinct(
            plane
            for plane in refined
            if plane.error <= most * MIRROR_TOLERANCE
            and plane.error * diagonal
            <= most * _ACROSS_TOLERANCE * float(np.ptp(plane.heights(samples)))
        )
    return planes[0] if planes else None


def _directions(about: FloatArray) -> list[FloatArray]:
    """Unit normals of candidate planes, those of the frame first."""
    moments, axes = pm.eigh((about[:, :, None] * about[:, None]).mean(axis=0))
    found = [*np.eye(3), *axes.T]
    for one in (0, 1):
        if moments[one + 1] - moments[one] <= _MOST_ALIKE * moments[one + 1]:
            angles = np.pi * np.arange(1, _N_TURNS) / _N_TURNS
            turns = zip(np.atleast_1d(pm.cos(angles)), np.atleast_1d(pm.sin(angles)), strict=True)
            found += [c * axes[:, one] + s * axes[:, one + 1] for c, s in turns]
    kept: list[FloatArray] = []
    for axis in found:
        if all(abs(float(pm.vecdot(axis, other))) < 1.0 - 1e-4 for other in kept):
            kept.append(np.asarray(axis))
    return kept


def _is_likely(
    plane: MirrorPlane, tree: TriangleTree, samples: FloatArray, diagonal: float
) -> bool:
    """Whether the mirror images of half of the samples lie close to the surface."""
    most = MIRROR_TOLERANCE * diagonal
    distances, _, _ = tree.closest_points(plane.mirrored(samples), max_distance=most, threads=1)
    return bool(2 * np.count_nonzero(distances <= most) >= len(samples))


def _refined(
    plane: MirrorPlane, tree: TriangleTree, samples: FloatArray, n_steps: int, diagonal: float
) -> MirrorPlane:
    """Move a plane so that the mirror images of samples come closer to the surface."""
    best = plane
    farthest = _FARTHEST * MIRROR_TOLERANCE * diagonal
    for _ in range(n_steps + 1):
        images = plane.mirrored(samples)
        distances, face_ids, weights = tree.closest_points(images, max_distance=farthest, threads=1)
        ordered = np.sort(np.minimum(distances, farthest))
        error = float(ordered[int(_SHARE * len(ordered))]) / diagonal
        if error < best.error:
            best = MirrorPlane(plane.normal, plane.offset, error)
        if error <= _EXACT:
            break
        near = distances <= min(ordered[int(_TRIMMED * len(ordered))], farthest)
        if np.count_nonzero(near) < len(near) // 2:
            break
        closest = pm.vecmat(weights[near], tree.positions[tree.faces[face_ids[near]]])
        plane = plane_between(samples[near], np.asarray(closest))
    return best


def plane_between(one: FloatArray, other: FloatArray, error: float = np.inf) -> MirrorPlane:
    """Least-squares plane that mirrors points (n, 3) onto others (n, 3)."""
    # |q - Rp|² = |q - p|² + 4 (n·p - d) (n·q - d): least for d = n·m, and the least eigenvector.
    center = (one + other).mean(axis=0) / 2.0
    products = ((one - center)[:, :, None] * (other - center)[:, None]).sum(axis=0)
    normal = pm.eigh((products + products.T) / 2.0)[1][:, 0]
    largest = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[largest])
    return MirrorPlane(normal, float(pm.vecdot(normal, center)), error)


def _distinct(planes: Iterable[MirrorPlane]) -> list[MirrorPlane]:
    """The best planes without those that are nearly the same, in the order of their errors."""
    kept: list[MirrorPlane] = []
    for plane in planes:
        if all(abs(float(pm.vecdot(plane.normal, other.normal))) < 0.9995 for other in kept):
            kept.append(plane)
    # Errors that differ by rounding alone count as equal, and planes then keep their order.
    return sorted(kept, key=lambda plane: round(plane.error * 2.0**14))[:_MOST_PLANES]
