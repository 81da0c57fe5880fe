"""Places labels beside points so that they hide neither one another nor the points.

It is greedy: each label takes the best of a few places around its point, labels of crowded points
first.

Based on: Christensen, Marks, Shieber, "An empirical study of algorithms for point-feature label
placement", ACM TOG 14(3), 1995, for the places and their order of preference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray

# Directions in turns, the best first, and distances in heights of a label.
_TURNS = (1 / 8, 7 / 8, 3 / 8, 5 / 8, 0.0, 1 / 2, 1 / 4, 3 / 4, 1 / 16, 15 / 16, 7 / 16, 9 / 16)
_DISTANCES = (0.35, 0.9, 1.6, 2.6, 4.0)
_MARK = 8.0  # radius of the mark of a point, in pixels
# Costs of hiding a point, leaving the frame and lying farther away, in areas of a label.
_POINT, _OUTSIDE, _FAR, _ORDER = 0.6, 8.0, 0.05, 0.004


def place_labels(points: FloatArray, sizes: FloatArray, frame: Sequence[float]) -> FloatArray:
    """(n, 2) lower left corners of labels of sizes (n, 2) at points (n, 2), pixels, y up."""
    n = len(points)
    away = pm.norm(points[:, None] - points[None, :], axis=-1)
    crowds = (away < 60.0).sum(axis=1)
    corners = np.zeros((n, 2))
    placed: list[int] = []
    for i in sorted(range(n), key=lambda i: (-crowds[i], i)):
        best, least = corners[i], math.inf
        for corner, bias in _places(points[i], sizes[i]):
            cost = bias + _cost(i, corner, points, sizes, corners, placed, frame)
            if cost < least:
                best, least = corner, cost
        corners[i] = best
        placed.append(i)
    return corners


def _places(point: FloatArray, size: FloatArray) -> list[tuple[FloatArray, float]]:
    places = []
    for far, distance in enumerate(_DISTANCES):
        for order, turn in enumerate(_TURNS):
            angle = 2.0 * math.pi * turn
            out = np.array([pm.cos(angle), pm.sin(angle)])
            # The side of the label that faces the point lies at this distance.
            center = (
                point + out * (_MARK + distance * size[1]) + 0.5 * size * np.sign(np.round(out, 6))
            )
            places.append((center - 0.5 * size, _FAR * far + _ORDER * order))
    return places


def _cost(
    i: int,
    corner: FloatArray,
    points: FloatArray,
    sizes: FloatArray,
    corners: FloatArray,
    placed: list[int],
    frame: Sequence[float],
) -> float:
    low, high = corner, corner + sizes[i]
    cost = 0.0
    if placed:
        others = np.array(placed)
        shared = np.minimum(high, corners[others] + sizes[others]) - np.maximum(
            low, corners[others]
        )
        cost += float(np.clip(shared, 0.0, None).prod(axis=1).sum() / sizes[i].prod())
    hidden = ((points > low - 2.0) & (points < high + 2.0)).all(axis=1)
    cost += _POINT * float(hidden.sum())
    left, bottom, right, top = frame
    if low[0] < left or low[1] < bottom or high[0] > right or high[1] > top:
        cost += _OUTSIDE
    return cost
