"""Hits so near an edge that float32 does not tell on which side: they are left to a second look.

Embree takes a ray that passes just beside a face for a hit, but only where it comes upon the face
at all, which the boxes of its tree decide. So it would depend on the tree which of the faces around
an edge or a vertex is hit. Such hits become misses, a few in ten thousand, and the exact second
look (`watertight`) finds the face.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.baking.found import Found
from texbake.baking.hits import NO_HIT
from texbake.baking.rays import Rays
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.parallel import run_bands

# How much thinner than usual triangles may be whose edges are told to be near in time.
_SLIVER = 0.1
# Of the distance to the farthest corner: how far from an edge Embree's test may err. Its moments of
# a ray about an edge have some 8 operations in float32, each rounded by 2^-24 of them.
_ERROR = 1e-6


def drop_doubtful(
    found: Found, rays: Rays, high: Mesh, frame: LocalFrame, threads: int | None
) -> int:
    """Turn hits whose ray passes an edge of its face too closely into misses, in place.

    Returns
    -------
    int
        How many.
    """
    n_misses = int(np.count_nonzero(found.faces == NO_HIT))
    # Barycentric; only hits that are nearer to an edge are looked at, since the corners of a face
    # mostly lie elsewhere in memory than those of the one before.
    usual = 1.0 / math.sqrt(max(high.n_faces, 1))
    farthest = float(rays.lengths.max(initial=0.0)) + usual
    near_edge = min(2.0 * _ERROR * farthest / (_SLIVER * usual), 1.0)
    triangles = (high.positions, high.faces, frame.center, frame.scale)

    def drop(start: int, stop: int) -> None:
        band = slice(start, stop)
        _drop_kernel(
            triangles,
            (rays.origins[band], rays.directions[band]),
            near_edge,
            (found.faces[band], found.barycentrics[band]),
            (found.distances[band], found.passed_back[band]),
        )

    run_bands(drop, len(rays), band=1 << 15, threads=threads)
    return int(np.count_nonzero(found.faces == NO_HIT)) - n_misses


@kernel
def _drop_kernel(triangles, lines, near_edge, places, others):  # type: ignore[no-untyped-def]
    """Hold hits near an edge against their triangle as float32 has it, which Embree was given.

    Based on: Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
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
        error = _ERROR * np.sqrt(far)
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
