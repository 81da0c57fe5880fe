"""Costs of seams per unit of length: low along edges where a seam is hard to see.

Seams cost little along hard edges, beveled or not, and where little ambient light comes, as in
creases, below chins and between fingers. They cost much within planes, and none runs within a
polygon. Rays from a sample of the vertices measure how
open their surroundings are; other vertices get the mean of those nearby.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.bevels import beveled_angles
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.raycast.rays import OPEN, Hemispheres, OcclusionRange, direction_sets, mixed
from texbake.raycast.scene import RayScene

# Weight of a hard edge, and of the angles, in degrees, at which edges begin to be hard and are.
_HARD = 0.3
_FLAT = 3.0  # weight of an edge within a plane
_SOFT_ANGLE, _HARD_ANGLE = 25.0, 50.0

# Rays per vertex, every how many vertices cast rays, and how many do at most. In each round, all
# vertices are averaged with their neighbors.
_RAYS, _STRIDE, _MOST = 8, 4, 8192
_ROUNDS = 4
# Rays start this far above the surface, in local units.
_OFFSET = 1e-4
# Where `hide` is 1, openness, relative to its mean, counts with this power, within these bounds.
_EXPONENT = 6.0
_HIDDEN, _OPEN = 0.1, 4.0


def edge_weights(
    surface: ChartSurface, *, hide: float = 0.0, keep_planes: bool = True
) -> FloatArray:
    """(F, 3) float64: weights of the edges from each corner to the next; infinite in polygons.

    `hide`: influence of openness, 0 to 1; `keep_planes`: make seams within planes dear.
    """
    corners, solid, opposite = surface.joints
    weights = np.ones(len(opposite))
    edges = np.flatnonzero(opposite >= 0).astype(np.int32)
    angles = _angles(surface.points, corners, edges // 3, opposite[edges] // 3)
    angles, flat = beveled_angles(surface.points, corners, edges, opposite[edges], angles)
    hard = np.clip((angles - _SOFT_ANGLE) / (_HARD_ANGLE - _SOFT_ANGLE), 0.0, 1.0)
    weights[edges] = 1.0 - (1.0 - _HARD) * hard
    if keep_planes:
        weights[edges[flat]] = _FLAT
    if hide > 0.0 and len(edges):
        openness = _openness(surface, corners, solid)
        ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
        along = (openness[ends[0]] + openness[ends[1]]) / 2.0
        mean = float(along.mean())
        if mean > 0.0:
            logs = pm.log(np.maximum(along / mean, _HIDDEN))
            weights *= np.clip(pm.exp(_EXPONENT * hide * logs), _HIDDEN, _OPEN)
    if surface.polygons is not None:
        same = surface.polygons[opposite // 3] == np.repeat(surface.polygons, 3)
        weights[(opposite >= 0) & same] = np.inf
    return weights.reshape(-1, 3)


def _angles(points: FloatArray, corners: IntArray, one: IntArray, other: IntArray) -> FloatArray:
    """(k,) degrees between the normals of faces."""
    normals = _normals(points, corners)
    crosses = pm.norm(np.cross(normals[one], normals[other]), axis=1)
    dots = (normals[one] * normals[other]).sum(axis=1)
    return np.asarray(np.degrees(pm.arctan2(crosses, dots)))


def _normals(points: FloatArray, corners: IntArray) -> FloatArray:
    """(F, 3) normals of faces, as long as twice their area."""
    a, b, c = (points[corners[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _openness(surface: ChartSurface, corners: IntArray, solid: BoolArray) -> FloatArray:
    """(V,) float64: open share of the surroundings, 0 to 1, averaged over neighbors."""
    n = len(surface.points)
    used = np.unique(corners[solid])
    step = max(_STRIDE, -(-len(used) // _MOST))
    chosen = used[::step] if len(used) > _STRIDE**3 else used
    mesh = Mesh(positions=surface.points, faces=corners[solid])
    frame = LocalFrame.around(mesh)
    normals = np.zeros((n, 3))
    for axis, values in enumerate(_normals(surface.points, corners[solid]).T):
        normals[:, axis] = np.bincount(corners[solid].ravel(), np.repeat(values, 3), minlength=n)
    lengths = pm.norm(normals[chosen], axis=1)
    axes = (normals[chosen] / np.where(lengths > 0.0, lengths, 1.0)[:, None]).astype(np.float32)
    scene = RayScene.build(mesh, frame, compact=True, threads=surface.threads)
    found = scene.cast_hemispheres(
        Hemispheres(
            frame.to_local(surface.points[chosen]), axes, axes, mixed(chosen.astype(np.uint32))
        ),
        direction_sets(_RAYS, 1, 128 * _RAYS),
        OcclusionRange(_OFFSET, np.inf, 0.0),
    )[:, OPEN]
    sums, counts = np.zeros(n), np.zeros(n)
    sums[chosen], counts[chosen] = np.nan_to_num(found, nan=1.0), 1.0
    tails, heads = corners[solid].ravel(), np.roll(corners[solid], -1, axis=1).ravel()
    for _ in range(_ROUNDS):
        for values in (sums, counts):
            values += np.bincount(tails, values[heads], minlength=n)
    mean = float(found.mean()) if len(found) else 1.0
    return np.where(counts > 0.0, sums / np.where(counts > 0.0, counts, 1.0), mean)
