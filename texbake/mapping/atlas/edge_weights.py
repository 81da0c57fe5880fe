"""What a seam along an edge costs, for each unit of its length."""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mesh.mesh import FloatArray, IntArray

# Weight of a hard edge, and of the angles, in degrees, at which edges begin to be hard and are.
_HARD = 0.3
_SOFT_ANGLE, _HARD_ANGLE = 25.0, 50.0


def edge_weights(surface: ChartSurface) -> FloatArray:
    """(F, 3) float64: weights of the edges from each corner to the next; infinite in polygons."""
    corners, _, opposite = surface.joints
    weights = np.ones(len(opposite))
    edges = np.flatnonzero(opposite >= 0).astype(np.int32)
    angles = _angles(surface.points, corners, edges // 3, opposite[edges] // 3)
    hard = np.clip((angles - _SOFT_ANGLE) / (_HARD_ANGLE - _SOFT_ANGLE), 0.0, 1.0)
    weights[edges] = 1.0 - (1.0 - _HARD) * hard
    if surface.polygons is not None:
        same = surface.polygons[opposite // 3] == np.repeat(surface.polygons, 3)
        weights[(opposite >= 0) & same] = np.inf
    return weights.reshape(-1, 3)


def _angles(points: FloatArray, corners: IntArray, one: IntArray, other: IntArray) -> FloatArray:
    """(k,) degrees between the normals of faces."""
    a, b, c = (points[corners[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    crosses = pm.norm(np.cross(normals[one], normals[other]), axis=1)
    dots = (normals[one] * normals[other]).sum(axis=1)
    return np.asarray(np.degrees(pm.arctan2(crosses, dots)))
