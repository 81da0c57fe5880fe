"""Where a ray meets a triangle, by Cramer's rule in float64: kernels that check hits of Embree.

Based on: Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.raycast.rays import NO_HIT

# How far from an edge Embree's test may err, relative to the distance of the farthest corner: the
# moments of a ray about an edge take some 8 operations in float32, each rounded by 2^-24.
EDGE_ERROR = 1e-6


@kernel
def refine_kernel(triangles, lines, results):  # type: ignore[no-untyped-def]
    """Find where each ray meets the plane of the triangle it hit, in float64, in place.

    A triangle so thin or so edge-on that the determinant vanishes keeps the distance and the
    barycentrics that are in `results`.
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
        # Inside according to float32, so it can only be outside by rounding, which is noticeable
        # only for a triangle seen edge-on: clamp to the triangle and use that point's distance.
        u = min(max(u, 0.0), 1.0)
        v = min(max(v, 0.0), 1.0 - u)
        barycentrics[i, 0] = u
        barycentrics[i, 1] = v
        distances[i] = (
            (u * bx + v * cx - ox) * dx + (u * by + v * cy - oy) * dy + (u * bz + v * cz - oz) * dz
        )


@kernel
def drop_uncertain_kernel(triangles, lines, near_edge, places, others):  # type: ignore[no-untyped-def]
    """Turn hits whose ray passes an edge too closely into misses, in place.

    Triangles and rays are rounded to float32 first, as Embree sees them.
    """
    positions, triangle_corners, center, scale = triangles
    origins, directions = lines
    faces, barycentrics = places
    distances, passed_back = others
    a, b, c = np.empty(3), np.empty(3), np.empty(3)
    d, n, q = np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(faces)):
        if faces[i] == NO_HIT:
            continue
        u, v = barycentrics[i, 0], barycentrics[i, 1]
        if min(u, v, 1.0 - u - v) > near_edge:
            continue
        corners = triangle_corners[faces[i]]
        for k in range(3):
            p = np.float64(np.float32((positions[corners[0], k] - center[k]) * scale))
            b[k] = np.float64(np.float32((positions[corners[1], k] - center[k]) * scale)) - p
            c[k] = np.float64(np.float32((positions[corners[2], k] - center[k]) * scale)) - p
            d[k] = np.float64(np.float32(directions[i, k]))
            a[k] = np.float64(np.float32(origins[i, k])) - p
        # n = b x c and q = d x a; Cramer's rule on a + t d = u b + v c
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            n[x] = b[y] * c[z] - b[z] * c[y]
            q[x] = d[y] * a[z] - d[z] * a[y]
        far = cc = bb = bc = 0.0
        for k in range(3):
            far += max(abs(a[k]), abs(a[k] - b[k]), abs(a[k] - c[k])) ** 2
            bb += b[k] * b[k]
            cc += c[k] * c[k]
            bc += (b[k] - c[k]) * (b[k] - c[k])
        error = EDGE_ERROR * np.sqrt(far)
        slope = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
        u = -(q[0] * c[0] + q[1] * c[1] + q[2] * c[2])
        v = q[0] * b[0] + q[1] * b[1] + q[2] * b[2]
        if slope < 0.0:
            slope, u, v = -slope, -u, -v
        # Moments of the ray about the edges, which grow with the edges' lengths.
        if (
            u < error * np.sqrt(cc)
            or v < error * np.sqrt(bb)
            or slope - u - v < error * np.sqrt(bc)
        ):
            faces[i] = NO_HIT
            distances[i] = 0.0
            passed_back[i] = False
            barycentrics[i, 0] = barycentrics[i, 1] = 0.0
