"""What rays hit: float32 finds which triangle, float64 finds where on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import NO_HIT
from texbake.baking.rows import Rows
from texbake.kernels import kernel


@dataclass(frozen=True, eq=False)
class Found(Rows):
    """What some rays hit, in the order of the rays.

    Attributes
    ----------
    faces : (n,) int32
        Face of the dense mesh, `NO_HIT` for none.
    barycentrics : (n, 2) float64
        Weights of its second and third corner.
    distances : (n,) float64
        Along the ray from its origin, in local units.
    passed_back : (n,) bool
        The ray met a surface from behind before that.
    """

    faces: npt.NDArray[np.int32]
    barycentrics: npt.NDArray[np.float64]
    distances: npt.NDArray[np.float64]
    passed_back: npt.NDArray[np.bool_]

    @classmethod
    def nothing(cls, n: int) -> Found:
        """Results of `n` rays that have hit nothing yet."""
        return cls(
            np.full(n, NO_HIT, dtype=np.int32),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n, dtype=np.bool_),
        )


@kernel
def refine_kernel(triangles, lines, results):  # type: ignore[no-untyped-def]
    """Find where each ray meets the plane of the triangle it hit, in float64, in place.

    Based on: Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997. A triangle
    so thin or so edge-on that the determinant vanishes keeps the distance that the caster found,
    and its barycentrics where it told some, else its first corner.
    """
    positions, triangle_corners, center, scale = triangles
    origins, directions, _ = lines
    faces, barycentrics, distances = results
    for i in range(len(faces)):
        if faces[i] == NO_HIT:
            continue
        p, q, r = triangle_corners[faces[i]]
        ax = (positions[p, 0] - center[0]) * scale
        ay = (positions[p, 1] - center[1]) * scale
        az = (positions[p, 2] - center[2]) * scale
        bx = (positions[q, 0] - center[0]) * scale - ax
        by = (positions[q, 1] - center[1]) * scale - ay
        bz = (positions[q, 2] - center[2]) * scale - az
        cx = (positions[r, 0] - center[0]) * scale - ax
        cy = (positions[r, 1] - center[1]) * scale - ay
        cz = (positions[r, 2] - center[2]) * scale - az
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        ox, oy, oz = origins[i, 0] - ax, origins[i, 1] - ay, origins[i, 2] - az
        # n = b x c and q = d x o; Cramer's rule on o + t d = u b + v c
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = dy * oz - dz * oy, dz * ox - dx * oz, dx * oy - dy * ox
        slope = -(dx * nx + dy * ny + dz * nz)
        if abs(slope) <= 1e-12 * (abs(nx) + abs(ny) + abs(nz)):
            continue
        u = -(qx * cx + qy * cy + qz * cz) / slope
        v = (qx * bx + qy * by + qz * bz) / slope
        # float32 found it inside, so it lies outside by rounding, which is much only on a triangle
        # seen edge-on: back onto the triangle, and the distance of that point along the ray.
        u = min(max(u, 0.0), 1.0)
        v = min(max(v, 0.0), 1.0 - u)
        barycentrics[i, 0] = u
        barycentrics[i, 1] = v
        distances[i] = (
            (u * bx + v * cx - ox) * dx + (u * by + v * cy - oy) * dy + (u * bz + v * cz - oz) * dz
        )
