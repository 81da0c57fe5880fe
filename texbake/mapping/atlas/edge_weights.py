"""Costs of seams per unit of length: low along edges where a seam is hard to see.

Seams cost little along hard edges, beveled or not, and where little ambient light comes, as in
creases, below chins and between fingers. They cost much within planes, and where the surface turns
in all directions, as at faces and ears; none runs within a polygon. Rays from a sample of the
vertices measure how open their surroundings are; other vertices get the mean of those nearby.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.bevels import face_crosses
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.raycast.rays import OPEN, Hemispheres, OcclusionRange, direction_sets, mixed
from texbake.raycast.scene import RayScene

# Weight of a hard edge, and of the angles, in degrees, at which edges begin to be hard and are.
_HARD = 0.3
_SOFT_ANGLE, _HARD_ANGLE = 25.0, 50.0
_FLAT = 3.0  # weight of an edge within a plane: chosen by the seams of plates with holes

# Rays per vertex, every how many vertices cast rays, and how many do at most. In each round, all
# vertices are averaged with their neighbors.
_RAYS, _STRIDE, _MOST = 8, 4, 8192
_ROUNDS = 4
# Rays start this far above the surface, in local units.
_OFFSET = 1e-4
# Where `hide` is 1, openness, relative to its mean, counts with this power, within these bounds.
_EXPONENT = 9.0
_HIDDEN, _OPEN = 0.3, 4.0
# The same power and lower bound where charts are not joined.
_MILD, _LEAST = 6.0, 0.1

# Cells, along the longest side, whose mean normal shows how much the surface turns: of length 1
# where it is flat. Between these shortfalls, edges become `_DETAILED` times as dear.
_CELLS = 32
_PLAIN, _DETAIL = 0.1, 0.5
_DETAILED = 8.0
_SHADED = 0.6  # openness, relative to its mean, up to which no detail shows


def edge_weights(surface: ChartSurface, *, hide: float = 0.0, joined: bool = True) -> FloatArray:
    """(F, 3) float64: weights of the edges from each corner to the next; infinite in polygons.

    `hide`: influence of openness, 0 to 1; `joined`: charts will be joined, so that seams across
    details, which cost more, can go.
    """
    corners, solid, opposite = surface.joints
    bevels = surface.bevels
    edges, angles = bevels.edges, bevels.angles
    soft = np.ones(len(opposite))
    soft[edges] -= np.clip((angles - _SOFT_ANGLE) / (_HARD_ANGLE - _SOFT_ANGLE), 0.0, 1.0)
    weights = _HARD + (1.0 - _HARD) * soft
    weights[edges[bevels.within]] = _FLAT
    if hide > 0.0 and len(edges):
        along = _along(_openness(surface, corners, solid), corners)
        if joined:
            seen = _seen(along, _detail(surface, soft), hide)
            steps = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
            lengths = pm.norm(steps.reshape(-1, 3), axis=1)
            weights *= seen * float(lengths.sum() / (lengths * seen).sum())
        else:
            logs = pm.log(np.maximum(along, _LEAST))
            weights *= np.clip(pm.exp(_MILD * hide * logs), _LEAST, _OPEN)
    if surface.polygons is not None:
        same = surface.polygons[opposite // 3] == np.repeat(surface.polygons, 3)
        weights[(opposite >= 0) & same] = np.inf
    return weights.reshape(-1, 3)


def _along(openness: FloatArray, corners: IntArray) -> FloatArray:
    """(3 F,) openness of edges, by that of vertices (V,), relative to its mean."""
    ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    along = (openness[ends[0]] + openness[ends[1]]) / 2.0
    return np.asarray(along / (float(along.mean()) or 1.0))


def _seen(along: FloatArray, detail: FloatArray, hide: float) -> FloatArray:
    """(3 F,) weights of edges by how open and detailed their surroundings are."""
    lit = np.clip((along - _SHADED) / (1.0 - _SHADED), 0.0, 1.0)
    logs = _EXPONENT * pm.log(np.maximum(along, _HIDDEN)) + float(pm.log(_DETAILED)) * detail * lit
    return np.clip(pm.exp(hide * logs), _HIDDEN, _OPEN)


def _detail(surface: ChartSurface, soft: FloatArray) -> FloatArray:
    """(3 F,) from 0 to 1 where the surface turns near edges, as far as these are `soft`."""
    opposite = surface.joints[2]
    turned = np.repeat(_turning(surface.points, surface.corners), 3)
    turned = (turned + turned[np.where(opposite >= 0, opposite, np.arange(len(opposite)))]) / 2.0
    return np.asarray(np.clip((turned - _PLAIN) / (_DETAIL - _PLAIN), 0.0, 1.0) * soft)


def _turning(points: FloatArray, corners: IntArray) -> FloatArray:
    """(F,) how much the surface turns near each face: 0 where it is flat, at most 1."""
    centers = points[corners].mean(axis=1)
    low = centers.min(axis=0)
    size = float(np.ptp(centers, axis=0).max())
    n = _CELLS + 2  # empty ones around them
    cells = np.minimum((centers - low) * (_CELLS / (size or 1.0)), _CELLS - 1).astype(np.int64) + 1
    keys = (cells[:, 0] * n + cells[:, 1]) * n + cells[:, 2]
    normals = face_crosses(points, corners)
    values = np.concatenate([normals.T, pm.norm(normals, axis=1)[None]])
    counted = np.stack([np.bincount(keys, each, n**3) for each in values])
    sums: FloatArray = counted.reshape(4, n, n, n).astype(np.float64)
    for axis in (1, 2, 3):
        sums = 2.0 * sums + np.roll(sums, 1, axis) + np.roll(sums, -1, axis)
    x, y, z, areas = sums.reshape(4, -1)[:, keys]
    return np.asarray(1.0 - np.sqrt(x * x + y * y + z * z) / np.maximum(areas, 1e-30))


def _openness(surface: ChartSurface, corners: IntArray, solid: BoolArray) -> FloatArray:
    """(V,) float64: open share of the surroundings, 0 to 1, averaged over neighbors."""
    n = len(surface.points)
    used = np.unique(corners[solid])
    step = max(_STRIDE, -(-len(used) // _MOST))
    chosen = used[::step] if len(used) > _STRIDE**3 else used
    mesh = Mesh(positions=surface.points, faces=corners[solid])
    frame = LocalFrame.around(mesh)
    normals = np.zeros((n, 3))
    for axis, values in enumerate(face_crosses(surface.points, corners[solid]).T):
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
