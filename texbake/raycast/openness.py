"""How open the surroundings of the vertices of a surface are, by rays from a sample of them.

Rays leave in the directions of a hemisphere, more of them along its axis. Vertices that cast none
get the mean of those nearby.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.distance import area_vectors
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.raycast.rays import OPEN, Hemispheres, OcclusionRange, direction_sets, mixed
from texbake.raycast.scene import RayScene

# Rays per vertex, every how many vertices cast rays, and how many do at most. In each round, all
# vertices are averaged with their neighbors: more often where those that cast rays are far apart.
_RAYS, _STRIDE, _MOST = 8, 4, 8192
_ROUNDS = 4
# Rays start this far above the surface, in local units.
_OFFSET = 1e-4


def openness(
    points: FloatArray,
    faces: IntArray,
    *,
    walls: IntArray | None = None,
    threads: int | None = None,
) -> FloatArray:
    """(V,) open share of the surroundings of vertices, 0 to 1, averaged over neighbors.

    On the side of the normals of `faces` (F, 3); or on the more open one, with `walls` (W, 3) as
    the only faces that rays meet. Vertices far from any that cast rays get the mean of all.
    """
    n = len(points)
    used = np.unique(faces)
    step = max(_STRIDE, -(-len(used) // _MOST))
    chosen = used[::step] if len(used) > _STRIDE**3 else used
    mesh = Mesh(positions=points, faces=faces)
    frame = LocalFrame.around(mesh)
    normals = np.zeros((n, 3))
    for axis, values in enumerate(area_vectors(points, faces).T):
        normals[:, axis] = np.bincount(faces.ravel(), np.repeat(values, 3), minlength=n)
    lengths = pm.norm(normals[chosen], axis=1)
    axes = (normals[chosen] / np.where(lengths > 0.0, lengths, 1.0)[:, None]).astype(np.float32)
    met = mesh if walls is None else mesh.replace(faces=walls)
    scene = RayScene.build(met, frame, compact=True, threads=threads)
    found = np.zeros(len(chosen), dtype=np.float32)
    for side in (axes,) if walls is None else (axes, -axes):
        open_shares = scene.cast_hemispheres(
            Hemispheres(
                frame.to_local(points[chosen]), side, side, mixed(chosen.astype(np.uint32))
            ),
            direction_sets(_RAYS, 1, 128 * _RAYS),
            OcclusionRange(_OFFSET, np.inf, 0.0),
        )[:, OPEN]
        found = np.maximum(found, np.nan_to_num(open_shares, nan=1.0))
    sums, counts = np.zeros(n), np.zeros(n)
    sums[chosen], counts[chosen] = found, 1.0
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    for _ in range(_ROUNDS * math.isqrt(step // _STRIDE)):
        for values in (sums, counts):
            values += np.bincount(tails, values[heads], minlength=n)
    mean = float(found.mean()) if len(found) else 1.0
    return np.where(counts > 0.0, sums / np.where(counts > 0.0, counts, 1.0), mean)
