"""Where the axis of a cylindrical mapping runs: through the circle around a prism's corners.

The middle of the bounding box is on the axis of a cylinder and of a prism with an even number of
sides, but not of a prism with an odd number: that of a triangle lies a twelfth of its width off.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.classical.frames import center_of, in_frame
from texbake.mapping.options.checks import Vector
from texbake.mesh.mesh import FloatArray, Mesh, frozen

# Directions about the axis in which the farthest corners are sought.
_DIRECTIONS = 32
# How far a corner may be off the circle, and how far the circle must be off the middle of the
# bounding box to count, both relative to the circle's radius.
_ROUNDING = 1e-6
_DECIMALS = 12


def center_about_axis(mesh: Mesh, center: Vector | None, frame: FloatArray) -> FloatArray:
    """(3,) float64: the given center; None for one on the axis of a prism, cone or pyramid.

    `frame` (3, 3) float64: rows as `frame_about` returns them, the axis last. Returns (3,) float64.
    """
    middle = center_of(mesh, center)
    if center is not None or mesh.n_faces == 0:
        return middle
    used = np.unique(mesh.faces)
    half = float(np.abs(mesh.bounds[1] / 2.0 - mesh.bounds[0] / 2.0).max())
    if not half > 0.0:
        return middle
    flat = in_frame((mesh.positions[used] - middle) / half, frame[:2])
    circle = _circle_around(flat)
    if circle is None or float(pm.hypot(*circle)) <= _ROUNDING:
        return middle
    return frozen(middle + half * (pm.matmul(circle, frame[:2])))


def _circle_around(points: FloatArray) -> FloatArray | None:
    """(2,): center of the circle through the outermost of points (n, 2); None if there is none."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    ways = np.stack([pm.cos(angles), pm.sin(angles)])
    outermost = points[np.unique([int((pm.matmul(points, way)).argmax()) for way in ways.T])]
    # |p|^2 = 2 c p + (r^2 - |c|^2) is linear in the center c.
    rows = np.column_stack([2.0 * outermost, np.ones(len(outermost))])
    found, rank = pm.lstsq(rows, np.square(outermost).sum(axis=1), rcond=_ROUNDING)
    if rank < 3:
        return None
    center = found[:2]
    radius = float(np.sqrt(found[2] + pm.matmul(center, center)))
    off = pm.hypot(*(outermost - center).T) - radius
    around = np.sort(pm.arctan2(*(outermost - center).T[::-1]))
    widest = float(np.diff(around, append=around[0] + 2.0 * np.pi).max())
    if np.abs(off).max() > _ROUNDING * radius or widest > np.pi:
        return None
    return np.asarray(np.round(center, _DECIMALS))  # whatever the linear algebra library
