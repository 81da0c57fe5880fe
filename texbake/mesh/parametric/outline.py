"""Rows of a surface about the y axis: the radii and heights of what is swept, with its normals.

Outlines run upwards on the outside, so that u to the right and v along the outline make normals
that point outwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.parametric.grid import circle_points, closed_lines, open_lines, part_way


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """What is swept about the axis, row by row; a crease is two rows at one place."""

    lines: IntArray  # (R,) int32; as `make_grid` takes them
    points: FloatArray  # (R, 2) float64; radius, exactly 0 on the axis, and height
    normals: FloatArray  # (R, 2) float64; unit normals in the plane of radius and height
    v: FloatArray  # (R,) float64


def straight_outline(start: tuple[float, float], end: tuple[float, float], n_rows: int) -> Outline:
    """Segment from one (radius, height) to another."""
    steps = np.arange(n_rows + 1)
    first, last = np.array(start), np.array(end)
    points = part_way(first, last, steps[:, None], n_rows)
    along = last - first
    normal = np.array([along[1], -along[0]]) / pm.hypot(*along)
    return Outline(
        lines=open_lines(n_rows),
        points=points,
        normals=np.broadcast_to(normal, points.shape),
        v=steps / n_rows,
    )


def half_circle(radius: float, n_rows: int) -> Outline:
    """Half circle about the origin, from its lowest point to its highest."""
    steps = np.arange(n_rows + 1)
    circle = circle_points(2 * n_rows)[steps]
    normals = np.stack([circle[:, 1], -circle[:, 0]], axis=-1)
    return Outline(
        lines=open_lines(n_rows), points=radius * normals, normals=normals, v=steps / n_rows
    )


def whole_circle(radius: float, minor_radius: float, n_rows: int) -> Outline:
    """Circle about (radius, 0), from its point nearest to the axis, downwards."""
    steps = np.arange(n_rows + 1)
    normals = -circle_points(n_rows)[steps % n_rows]
    return Outline(
        lines=closed_lines(n_rows),
        points=np.array([radius, 0.0]) + minor_radius * normals,
        normals=normals,
        v=steps / n_rows,
    )


def profile_outline(profile: FloatArray, n_rows: int, crease: float) -> Outline:
    """Straight segments between points, each in equal parts.

    `profile` (n, 2) float64.
    """
    points = _oriented(_pruned(profile))
    edges = np.diff(points, axis=0)
    lengths = pm.hypot(edges[:, 0], edges[:, 1])
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / lengths[:, None]
    starts, ends, smooth = _segment_normals(points, normals, lengths, np.radians(crease))
    ends_v = np.cumsum(lengths)
    ends_v /= ends_v[-1]
    starts_v = np.concatenate([[0.0], ends_v[:-1]])
    parts = np.maximum(1, np.rint(n_rows * lengths / lengths.sum())).astype(np.int64)
    # Row by row: the segment it is on and the step on it. After a smooth point the first row of
    # a segment is the last of the one before.
    segment = np.repeat(np.arange(len(parts)), parts + 1)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(parts + 1) - parts - 1, parts + 1)
    keep = (step > 0) | ~np.concatenate([[False], smooth])[segment]
    lines = (np.cumsum(parts) - parts)[segment] + step
    if _is_closed(points):
        lines %= parts.sum()
    segment, step, lines = segment[keep], step[keep], lines[keep]

    def between(first: FloatArray, last: FloatArray) -> FloatArray:
        return part_way(first[segment], last[segment], step[:, None], parts[segment, None])

    start, end = starts_v[segment], ends_v[segment]
    v = np.where(step == parts[segment], end, start + (end - start) * (step / parts[segment]))
    return Outline(
        lines=lines.astype(np.int32),
        points=between(points[:-1], points[1:]),
        normals=_unit(between(starts, ends)),
        v=v,
    )


def _pruned(profile: FloatArray) -> FloatArray:
    """Points without repeats, and without ends that run along the axis."""
    points = profile[np.append(True, (profile[1:] != profile[:-1]).any(axis=1))]
    off_axis = np.flatnonzero(points[:, 0] > 0.0)
    kept: FloatArray = points[max(off_axis[0] - 1, 0) : off_axis[-1] + 2]
    return kept


def _oriented(points: FloatArray) -> FloatArray:
    """Points in the order in which the volume that they enclose about the axis is not negative."""
    scaled = points / np.abs(points).max()  # so that nothing overflows
    r, s = scaled[:-1, 0], scaled[1:, 0]
    volume = ((r * r + r * s + s * s) * np.diff(scaled[:, 1])).sum()
    return points[::-1] if volume < 0.0 else points


def _is_closed(points: FloatArray) -> bool:
    return len(points) > 3 and points[0, 0] > 0.0 and bool((points[0] == points[-1]).all())


def _segment_normals(
    points: FloatArray, normals: FloatArray, lengths: FloatArray, crease: float
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Normals at the start and at the end of each segment, and which inner points are smooth."""
    starts, ends = normals.copy(), normals.copy()
    smooth = _turn(normals[:-1], normals[1:]) <= crease
    before, after = np.flatnonzero(smooth), np.flatnonzero(smooth) + 1
    ends[before] = starts[after] = _mean(
        normals[before], normals[after], lengths[before], lengths[after]
    )
    if _is_closed(points):
        if _turn(normals[-1], normals[0]) <= crease:
            ends[-1] = starts[0] = _mean(normals[-1], normals[0], lengths[-1], lengths[0])
    else:
        mirror = np.array([-1.0, 1.0])
        for tip, at, end in ((points[0], starts, 0), (points[-1], ends, -1)):
            if tip[0] == 0.0 and _turn(normals[end], mirror * normals[end]) <= crease:
                at[end] = 0.0, np.copysign(1.0, normals[end, 1])
    return starts, ends, smooth


def _mean(
    first: FloatArray, second: FloatArray, first_lengths: FloatArray, second_lengths: FloatArray
) -> FloatArray:
    """Unit mean of normals of neighboring segments, the shorter counting more."""
    share = first_lengths / (first_lengths + second_lengths)
    mean = (1.0 - share)[..., None] * first + share[..., None] * second
    return _unit(mean)


def _turn(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angle between vectors, in radians."""
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    angle: FloatArray = pm.arctan2(np.abs(cross), (first * second).sum(axis=-1))
    return angle


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / pm.hypot(vectors[..., :1], vectors[..., 1:])
    return unit
