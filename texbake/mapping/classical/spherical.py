"""Spherical mapping: longitude to s, latitude to t.

A sphere pinches at its poles, where all values of s meet in one point. A corner at a pole has no
longitude of its own; it takes that of each of its faces, so that they fan out side by side.

Based on: Bier, Sloan, "Two-part texture mappings", 1986. It departs in computing both angles by
atan2, which is as exact near the poles and the seam as elsewhere; the arc cosine is not.
"""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.classical.frames import center_of, frame_about, points_about, wrap_angles
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import FloatArray, IntArray, Mesh


def spherical(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh by the directions from a center to its points.

    Examples
    --------
    >>> from texbake.mesh.shapes import uv_sphere
    >>> dict(spherical(uv_sphere(8, 16), UnwrapOptions(method="spherical", axis="z")).tallies)
    {'faces touching a pole': 32}
    """
    frame = frame_about("y" if options.axis is None else options.axis)
    local = points_about(mesh, center_of(mesh, options.center), frame)
    return onto_sphere(
        local.points,
        mesh.faces,
        theta=options.theta,
        rounding=local.rounding,
        polygons=mesh.polygon_of,
    )


def onto_sphere(
    points: FloatArray,
    faces: IntArray,
    *,
    theta: tuple[float, float],
    rounding: float,
    polygons: IntArray | None = None,
) -> Projected:
    """Longitudes and latitudes of the corners of faces.

    `points` (N, 3) float64; `faces` (F, 3) int; `theta`: longitudes in degrees that become s = 0
    and s = 1; `polygons` (F,) int32.

    A corner at a pole gets the longitude of the centroid of its face; one at the center has
    latitude 0.
    """
    angles = wrap_angles(points, faces, theta=theta, rounding=rounding, polygons=polygons)
    t = latitude_coordinates(points, rounding)
    at_center = np.abs(points).max(axis=1) <= rounding
    n_at_center = int(at_center[faces].sum())
    return Projected(
        corners=np.stack([angles.s, t[faces]], axis=2),
        tallies=angles.tallies("a pole")
        | ({"corners at the center": n_at_center} if n_at_center else {}),
    )


def latitude_coordinates(points: FloatArray, rounding: float) -> FloatArray:
    """Latitudes as a texture coordinate, t = 1/2 + latitude / pi.

    `points` (N, 3) float64; `rounding`: points no farther than this from the center have latitude
    0; other points no farther than this from the axis are at a pole. Returns (N,) float64, in [0,
    1].
    """
    x, y, height = points.T
    radius = pm.hypot(x, y)
    t = 0.5 + pm.arctan2(height, radius) / np.pi
    at_pole = radius <= rounding
    t[at_pole] = np.where(height[at_pole] > 0.0, 1.0, 0.0)
    t[at_pole & (np.abs(height) <= rounding)] = 0.5
    return np.asarray(t)
