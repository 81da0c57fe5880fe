"""Costs of seams per unit of length: low along edges where a seam is hard to see.

Seams cost little along hard edges, beveled or not, and where little ambient light comes, as in
creases, below chins and between fingers. They cost much within planes, where the surface turns in
all directions, as at faces and ears, and on the front, the side that most of such detail faces;
none runs within a polygon. Rays from a sample of the vertices measure how open their surroundings
are; other vertices get the mean of those nearby.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mesh.distance import area_vectors
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.symmetry import MirrorPlane
from texbake.records import dataclass

# Weight of a hard edge, and of the angles, in degrees, at which edges begin to be hard and are.
_HARD = 0.3
_SOFT_ANGLE, _HARD_ANGLE = 25.0, 50.0
_FLAT = 3.0  # weight of an edge within a plane: chosen by the seams of plates with holes

# Where `hide` is 1, openness, relative to its mean, counts with this power, within these bounds.
_EXPONENT = 9.0
_HIDDEN, _OPEN = 0.3, 4.0
# The same power and lower bound where charts are not joined.
_MILD, _LEAST = 6.0, 0.1

# Cells, along the longest side, whose mean normal shows how much the surface turns: of length 1
# where it is flat. Between these amounts, the cost of edges rises to
# `_DETAILED` times as much.
_CELLS = 32
_PLAIN, _DETAIL = 0.1, 0.5
_DETAILED = 8.0
_SHADED = 0.6  # openness, relative to its mean, up to which no detail shows

# Edges that face the front cost this many times as much if the front is clear: if most of the
# detail in the light faces it, by the length of the mean normal of the detail.
_FRONTAL = 16.0
_NO_FRONT, _CLEAR_FRONT = 0.25, 0.4
_BESIDE = 0.5  # distance from the mirror plane, in greatest ones, from which nothing has a front


# Hiding seams is worth some length where the front is clearer than this, or the darkest quarter of
# the edges gets less light than this, relative to the mean.
_FRONT, _SHADE = 0.5, 0.85


@dataclass(frozen=True, eq=False)
class EdgeWeights:
    """Costs of seams along edges."""

    weights: FloatArray  # (F, 3), for each edge from a corner to the next; infinite in polygons
    is_worth_length: bool = False  # whether much can be hidden: there is a clear front, or shade


def edge_weights(
    surface: ChartSurface,
    *,
    hide: float = 0.0,
    joined: bool = True,
    plane: MirrorPlane | None = None,
) -> EdgeWeights:
    """Weigh the edges of a surface.

    `hide`: influence of openness, 0 to 1; `joined`: charts will be joined, so that seams across
    details and down the front, which cost more, can go; `plane`: of a symmetric surface.
    """
    corners, _, opposite = surface.joints
    bevels = surface.bevels
    edges, angles = bevels.edges, bevels.angles
    soft = np.ones(len(opposite))
    soft[edges] -= np.clip((angles - _SOFT_ANGLE) / (_HARD_ANGLE - _SOFT_ANGLE), 0.0, 1.0)
    weights = _HARD + (1.0 - _HARD) * soft
    weights[edges[bevels.within]] = _FLAT
    is_worth_length = False
    if hide > 0.0 and len(edges):
        along = _along(surface.openness, corners)
        if joined:
            seen, clarity = _seen(surface, along, soft, hide, plane)
            is_worth_length = clarity > _FRONT or float(np.quantile(along, 0.25)) < _SHADE
            steps = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
            lengths = pm.norm(steps.reshape(-1, 3), axis=1)
            weights *= seen * float(lengths.sum() / (lengths * seen).sum())
        else:
            logs = pm.log(np.maximum(along, _LEAST))
            weights *= np.clip(pm.exp(_MILD * hide * logs), _LEAST, _OPEN)
    if surface.polygons is not None:
        same = surface.polygons[opposite // 3] == np.repeat(surface.polygons, 3)
        weights[(opposite >= 0) & same] = np.inf
    return EdgeWeights(weights.reshape(-1, 3), is_worth_length)


def _along(openness: FloatArray, corners: IntArray) -> FloatArray:
    """(3 F,) openness of edges, by that of vertices (V,), relative to its mean."""
    ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    along = (openness[ends[0]] + openness[ends[1]]) / 2.0
    return np.asarray(along / (float(along.mean()) or 1.0))


def _seen(
    surface: ChartSurface,
    along: FloatArray,
    soft: FloatArray,
    hide: float,
    plane: MirrorPlane | None,
) -> tuple[FloatArray, float]:
    """(3 F,) weights by openness `along` `soft` edges, detail and the front; how clear that is."""
    lit = np.clip((along - _SHADED) / (1.0 - _SHADED), 0.0, 1.0)
    means, bent, shown = _turning(surface.points, surface.corners)
    front = _front(surface, shown**2 * lit.reshape(-1, 3).mean(axis=1), plane)
    # Where there is a front, its features count, and bends such as rims do not.
    turned = _at_edges(surface, shown if front.any() else bent)
    detail = np.clip((turned - _PLAIN) / (_DETAIL - _PLAIN), 0.0, 1.0) * soft
    logs = _EXPONENT * pm.log(np.maximum(along, _HIDDEN)) + float(pm.log(_DETAILED)) * detail * lit
    frontal = _at_edges(surface, np.maximum(pm.matmul(means, front), 0.0)) * soft
    seen = np.clip(pm.exp(hide * logs), _HIDDEN, _OPEN)
    seen = np.asarray(seen * pm.exp(hide * float(pm.log(_FRONTAL)) * frontal))
    return seen, float(pm.norm(front))


def _at_edges(surface: ChartSurface, values: FloatArray) -> FloatArray:
    """(3 F,) means of the values (F,) of the faces at each edge."""
    opposite = surface.joints[2]
    owned = np.repeat(values, 3)
    return (owned + owned[np.where(opposite >= 0, opposite, np.arange(len(opposite)))]) / 2.0


def _front(surface: ChartSurface, shown: FloatArray, plane: MirrorPlane | None) -> FloatArray:
    """(3,) direction that most detail faces, of which each face shows (F,) some; 0 if unclear.

    The length, at most 1, says how clear it is.
    """
    corners = surface.points[surface.corners]
    if plane is not None:  # detail far from it, such as ears, faces sideways
        heights = np.abs(plane.heights(corners.mean(axis=1)))
        shown = shown * np.maximum(1.0 - heights / (_BESIDE * float(heights.max()) or 1.0), 0.0)
    normals = area_vectors(surface.points, surface.corners)
    total = float((pm.norm(normals, axis=1) * shown).sum())
    front: FloatArray = (normals * shown[:, None]).sum(axis=0) / (total or 1.0)
    if plane is not None:
        front = front - float(pm.vecdot(front, plane.normal)) * plane.normal
    length = float(pm.norm(front))
    share = np.clip((length - _NO_FRONT) / (_CLEAR_FRONT - _NO_FRONT), 0.0, 1.0)
    return np.asarray(front * (share / (length or 1.0)))


def _turning(points: FloatArray, corners: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(F, 3) mean normal near each face; (F,) how much it turns, and how much in all directions.

    With the variances a, b and c of the normals along their principal axes, the latter is
    √(ab + bc + ca): 0 along a straight edge, and a quarter of the squared radius of a small cap.
    """
    centers = points[corners].mean(axis=1)
    low = centers.min(axis=0)
    size = float(np.ptp(centers, axis=0).max())
    n = _CELLS + 2  # empty ones around them
    cells = np.minimum((centers - low) * (_CELLS / (size or 1.0)), _CELLS - 1).astype(np.int64) + 1
    keys = (cells[:, 0] * n + cells[:, 1]) * n + cells[:, 2]
    crosses = area_vectors(points, corners)
    areas = np.maximum(pm.norm(crosses, axis=1), 1e-30)
    normals = crosses / areas[:, None]
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    values = [areas, *crosses.T, *(crosses[:, i] * normals[:, j] for i, j in pairs)]
    counted = np.stack([np.bincount(keys, each, n**3) for each in values])
    sums: FloatArray = counted.reshape(-1, n, n, n).astype(np.float64)
    for axis in (1, 2, 3):
        sums = 2.0 * sums + np.roll(sums, 1, axis) + np.roll(sums, -1, axis)
    found = sums.reshape(len(values), -1)[:, keys]
    x, y, z = found[1:4]
    bent = 1.0 - np.sqrt(x * x + y * y + z * z) / np.maximum(found[0], 1e-30)
    found = found[1:] / np.maximum(found[0], 1e-30)
    means = found[:3]
    (xx, yy, zz), (xy, yz, zx) = found[3:6] - means**2, found[6:] - means * np.roll(means, -1, 0)
    squares = xx * yy + yy * zz + zz * xx - xy**2 - yz**2 - zx**2
    return np.ascontiguousarray(means.T), bent, np.sqrt(np.maximum(squares, 0.0))
