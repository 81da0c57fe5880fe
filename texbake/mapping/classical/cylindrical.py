"""Cylindrical and spherical mapping: the angle about an axis to s, height or latitude to t.

A cylinder smears faces that look along the axis. They can be mapped by planes instead, as caps;
side and caps then lie in one texture at one texel density:

    +-------------+ +-------------+
    |  seen from  | |  seen from  |
    |  the end of | |  the other  |
    |  the axis   | |  end        |
    +-------------+ +-------------+
    +-----------------------------+
    | side: angle x mean radius   |
    |       and height            |
    +-----------------------------+

A sphere pinches at its poles, where all values of s meet in one point. A corner at a pole has no
longitude of its own; it takes that of each of its faces, so that they fan out side by side.

Based on: Bier, Sloan, "Two-part texture mappings", 1986 (the S mappings of the cylinder and the
sphere). It departs in computing both angles of the sphere by atan2, which is as exact near the
poles and the seam as elsewhere; the arc cosine is not.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.classical.frames import (
    LocalPoints,
    center_of,
    frame_about,
    in_frame,
    points_about,
    wrap_angles,
)
from texbake.mapping.corner_uvs import Projected, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.shared import Vector
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import face_normals

# Directions about the axis in which the farthest corners are sought.
_DIRECTIONS = 32
# How far a corner may be off the circle, and how far the circle must be off the middle of the
# bounding box to count, both relative to the circle's radius.
_ROUNDING = 1e-6
_DECIMALS = 12


def center_about_axis(mesh: Mesh, center: Vector | None, frame: FloatArray) -> FloatArray:
    """(3,) the given center, or one on the axis of a prism by the circle of its outer corners."""
    middle = center_of(mesh, center)
    if center is not None or mesh.n_faces == 0:
        return middle
    used = np.unique(mesh.faces)
    half = float(np.abs(mesh.bounds[1] / 2.0 - mesh.bounds[0] / 2.0).max())
    if not half > 0.0:
        return middle
    circle = _circle_around(in_frame((mesh.positions[used] - middle) / half, frame[:2]))
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


# Faces with normals within 45 degrees of the axis are caps, including those at exactly 45 degrees,
# however float32 positions are rounded.
_CAP_COSINE = math.sqrt(0.5) - 1e-6
_GAP = 1.0 / 64.0  # between side and caps, as a share of the texture: 16 texels of 1024


def cylindrical(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh by the angles and heights of its points about an axis."""
    frame = frame_about("y" if options.axis is None else options.axis)
    local = points_about(mesh, center_about_axis(mesh, options.center, frame), frame)
    if not options.caps:
        angles = wrap_angles(
            local.points,
            mesh.faces,
            theta=options.theta,
            rounding=local.rounding,
            polygons=mesh.polygon_of,
        )
        t, _ = _heights(local, mesh.faces, options)
        corners = np.stack([angles.s, t[mesh.faces]], axis=2)
        return Projected(corners=corners, tallies=angles.tallies())
    normals = face_normals(mesh)
    cosines = in_frame(normals, frame[2:])[:, 0]
    if mesh.polygon_of is not None:
        cosines = _of_polygons(mesh, normals, cosines, frame)
    side = np.abs(cosines) < _CAP_COSINE
    return _with_caps(mesh, options, local, side=side, above=cosines > 0.0)


def _of_polygons(
    mesh: Mesh, normals: FloatArray, cosines: FloatArray, frame: FloatArray
) -> FloatArray:
    """(F,) cosine of the polygon of each face; its own where a polygon faces both ways."""
    assert mesh.polygon_of is not None
    areas = surface_areas(mesh.positions[mesh.faces])
    sums = [np.bincount(mesh.polygon_of, areas * normals[:, axis]) for axis in range(3)]
    normal = np.stack(sums, axis=1).astype(np.float64)
    lengths = np.sqrt(pm.vecdot(normal, normal))
    along = in_frame(normal, frame[2:])[:, 0] / np.where(lengths > 0.0, lengths, 1.0)
    n_up, n_down = (np.bincount(mesh.polygon_of, way) for way in (cosines > 0.0, cosines < 0.0))
    agree = (n_up == 0) | (n_down == 0) | (np.abs(along) < _CAP_COSINE)
    return np.asarray(np.where(agree[mesh.polygon_of], along[mesh.polygon_of], cosines))


def _with_caps(
    mesh: Mesh, options: UnwrapOptions, local: LocalPoints, *, side: BoolArray, above: BoolArray
) -> Projected:
    """Map the side by angles and heights, and the caps by planes, above the side."""
    corners = np.empty((mesh.n_faces, 3, 2))
    angles = wrap_angles(
        local.points,
        mesh.faces[side],
        theta=options.theta,
        rounding=local.rounding,
        polygons=None if mesh.polygon_of is None else mesh.polygon_of[side],
    )
    arc = math.radians(abs(options.theta[1] - options.theta[0]))
    per_length = 1.0 / (arc * _mean_radius(local, mesh.faces, side))
    t, length = _heights(local, mesh.faces[side], options)
    corners[side, :, 0] = angles.s
    corners[side, :, 1] = (t * (length * per_length))[mesh.faces[side]]

    e1, e2, _ = local.points.T
    tallies = angles.tallies()
    right, top = 0.0, max(length * per_length, corners[side, :, 1].max(initial=0.0))
    left, bottom = 0.0, top + (_GAP if side.any() else 0.0)
    # The front, at angle 0, is at the bottom of the upper cap and at the top of the lower one, as
    # if both were unfolded from the side.
    for name, faces, up in (("caps above", ~side & above, -e1), ("caps below", ~side & ~above, e1)):
        if faces.any():
            plane = np.stack([e2, up], axis=1) * per_length
            used = plane[mesh.faces[faces]]
            low, high = used.reshape(-1, 2).min(axis=0), used.reshape(-1, 2).max(axis=0)
            corners[faces] = used - low + (left, bottom)
            right, top = left + high[0] - low[0], max(top, bottom + high[1] - low[1])
            left = right + _GAP
            tallies[name] = int(faces.sum())
    corners /= max(1.0, right, top)
    return Projected(corners=corners, tallies=tallies)


def _heights(
    local: LocalPoints, faces: IntArray, options: UnwrapOptions
) -> tuple[FloatArray, float]:
    """Coordinate t of vertices, and the local length along the axis of 1 in t; 0 without range."""
    heights = local.points[:, 2]
    first, last = height_ends(local, faces, options)
    if first == last:
        return np.zeros(len(heights)), 0.0
    return (heights - first) / (last - first), abs(last - first)


def height_ends(local: LocalPoints, faces: IntArray, options: UnwrapOptions) -> tuple[float, float]:
    """Heights, in local units, that become t = 0 and t = 1, by the options or the faces."""
    if options.height is not None:
        return options.height[0] * local.scale, options.height[1] * local.scale
    if len(faces) == 0:
        return 0.0, 0.0
    heights = local.points[faces, 2]
    first, last = float(heights.min()), float(heights.max())
    return (first, last) if last - first > local.rounding else (first, first)


def _mean_radius(local: LocalPoints, faces: IntArray, side: BoolArray) -> float:
    """Mean distance of the side's corners, or all, from the axis, by areas; 1 if all are on it."""
    points = local.points[faces[side] if side.any() else faces]
    areas = surface_areas(points)
    total = float(areas.sum())
    weights = areas / total if total > 0.0 else np.full(len(points), 1.0 / len(points))
    mean = float((pm.hypot(points[:, :, 0], points[:, :, 1]).mean(axis=1) * weights).sum())
    return mean if mean > local.rounding else 1.0


def spherical(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh by the directions from a center to its points."""
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
    """Longitudes and latitudes of the corners of faces, degrees `theta` as s = 0 and s = 1.

    A corner within `rounding` of the axis is at a pole, and gets the longitude of its face's
    centroid; one at the center has latitude 0.
    """
    angles = wrap_angles(points, faces, theta=theta, rounding=rounding, polygons=polygons)
    x, y, height = points.T
    radius = pm.hypot(x, y)
    t = np.asarray(0.5 + pm.arctan2(height, radius) / np.pi)
    at_pole = radius <= rounding
    t[at_pole] = np.where(height[at_pole] > 0.0, 1.0, 0.0)
    t[at_pole & (np.abs(height) <= rounding)] = 0.5
    at_center = np.abs(points).max(axis=1) <= rounding
    return Projected(
        corners=np.stack([angles.s, t[faces]], axis=2),
        tallies=angles.tallies("a pole") | {"corners at the center": int(at_center[faces].sum())},
    )
