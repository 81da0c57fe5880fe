"""Surfaces of revolution about the y axis: cylinder, cone, sphere, torus, and any profile.

All are closed vertex by vertex, face outwards, and have exact normals. A pole is a single vertex
whose normal in each face is the one at the middle u of the face: at the tip of a cone, the normal
of its side; at the poles of a sphere, the axis.

A profile file has a radius and a height per line, as in::

    # radius height
    0.0  0.0
    0.8  0.1
    1.0  0.9

Outlines run upwards on the outside, so that u to the right and v along the outline make normals
that point outwards.

Based on: do Carmo, "Differential Geometry of Curves and Surfaces", 1976, section 2-3, example 4.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError, TexbakeError
from texbake.files import PathLike
from texbake.mesh.files.source import parse_row, read_lines
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.parametric.grid import (
    circle_points,
    closed_lines,
    grid_mesh,
    half_steps,
    make_grid,
    open_lines,
    part_way,
)
from texbake.mesh.parametric.options import check_triangles
from texbake.records import dataclass


@dataclass(frozen=True, eq=False)
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
    normals = np.broadcast_to(normal, points.shape)
    return Outline(open_lines(n_rows), points, normals, steps / n_rows)


def profile_outline(profile: FloatArray, n_rows: int, crease: float) -> Outline:
    """Straight segments between points (n, 2), each in equal parts."""
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
    rows = between(points[:-1], points[1:])
    return Outline(lines.astype(np.int32), rows, _unit(between(starts, ends)), v)


def _pruned(profile: FloatArray) -> FloatArray:
    """Points without repeats, and without ends that run along the axis."""
    points = profile[np.append(True, (profile[1:] != profile[:-1]).any(axis=1))]
    off_axis = np.flatnonzero(points[:, 0] > 0.0)
    return np.asarray(points[max(off_axis[0] - 1, 0) : off_axis[-1] + 2])


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
) -> tuple[FloatArray, FloatArray, BoolArray]:
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
    return np.asarray(pm.arctan2(np.abs(cross), (first * second).sum(axis=-1)))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / pm.hypot(vectors[..., :1], vectors[..., 1:]))


@dataclass(frozen=True, kw_only=True, eq=False)
class SweptColumns:
    """Where the columns of a surface about the y axis stand."""

    lines: IntArray  # (C,) int32; as `make_grid` takes them
    u: FloatArray  # (2 C - 1,) float64; at half steps
    points: FloatArray  # (2 C - 1, 2) float64; (x, z) where the radius is 1
    normals: FloatArray  # (2 C - 1, 2) float64; (x, z) of the unit normal of the upright surface
    # Distance of the axis from the middle of a flat side, where the radius is 1; 1 where the
    # surface is round.
    inner_radius: float = 1.0


def round_columns(n_columns: int, turns: float = 1.0) -> SweptColumns:
    """Columns evenly spaced on a circle, or on the front part of it."""
    steps = np.arange(2 * n_columns + 1)
    if turns == 1.0:
        points = _xz(circle_points(2 * n_columns)[(steps + n_columns) % (2 * n_columns)])
        lines = closed_lines(n_columns)
    else:
        angles = np.pi * turns / n_columns * (steps - n_columns)
        points = np.stack([pm.sin(angles), pm.cos(angles)], axis=-1)
        lines = open_lines(n_columns)
    return SweptColumns(lines=lines, u=steps / (2 * n_columns), points=points, normals=points)


def flat_columns(n_columns: int, sides: int) -> SweptColumns:
    """At least `n_columns` evenly on the sides of a regular polygon, a corner at the seam."""
    per_side = -(-n_columns // sides)
    n_columns = sides * per_side
    side, step = (axis.ravel() for axis in np.indices((sides, per_side + 1)))
    numbers = side * per_side + step
    # The seam, u = 0, is at the back: half a turn from where the angle is 0.
    corners = -_xz(circle_points(sides))
    middles = -_xz(circle_points(2 * sides)[1::2])
    points = part_way(corners[side], corners[(side + 1) % sides], step[:, None], per_side)
    return SweptColumns(
        lines=(numbers % n_columns).astype(np.int32),
        u=half_steps(numbers / n_columns),
        points=half_steps(points),
        normals=half_steps(middles[side]),
        inner_radius=float(pm.cos(np.pi / sides)),
    )


def _xz(points: FloatArray) -> FloatArray:
    """Turn (cosine, sine) of angles about y, counted from z, into (x, z)."""
    return points[:, ::-1]


def make_cylinder(
    *, resolution: tuple[int, int], radius: float, height: float, sides: int | None, caps: bool
) -> Mesh:
    """Cylinder, or prism, about the origin; see `_side_and_caps`."""
    return _side_and_caps("cylinder", resolution, (radius, radius), height, sides, caps)


def make_cone(
    *, resolution: tuple[int, int], radius: float, height: float, sides: int | None, caps: bool
) -> Mesh:
    """Cone, or pyramid, with its tip at the top; see `_side_and_caps`."""
    return _side_and_caps("cone", resolution, (radius, 0.0), height, sides, caps)


def make_sphere(*, resolution: tuple[int, int], radius: float) -> Mesh:
    """Sphere about the origin; u is the longitude, v the latitude."""
    n_u, n_v = resolution
    steps = np.arange(n_v + 1)
    circle = circle_points(2 * n_v)[steps]  # half of it, from its lowest point to its highest
    normals = np.stack([circle[:, 1], -circle[:, 0]], axis=-1)
    outline = Outline(open_lines(n_v), radius * normals, normals, steps / n_v)
    return _sweep(round_columns(n_u), outline, "sphere")


def make_torus(*, resolution: tuple[int, int], radius: float, minor_radius: float) -> Mesh:
    """Torus about the origin; v goes around the tube and is 1/2 where it is farthest out."""
    n_u, n_v = resolution
    steps = np.arange(n_v + 1)
    normals = -circle_points(n_v)[steps % n_v]  # from the point nearest to the axis, downwards
    points = np.array([radius, 0.0]) + minor_radius * normals
    return _sweep(
        round_columns(n_u), Outline(closed_lines(n_v), points, normals, steps / n_v), "torus"
    )


def make_revolution(
    *, resolution: tuple[int, int], profile: FloatArray, turns: float, crease: float
) -> Mesh:
    """Surface of revolution of a profile (n, 2) float64; `crease` in degrees."""
    outline = profile_outline(profile, resolution[1], crease)
    check_triangles(2 * resolution[0] * (int(outline.lines.max()) + 1))
    return _sweep(round_columns(resolution[0], turns), outline, "revolution")


def _side_and_caps(
    name: str,
    resolution: tuple[int, int],
    radii: tuple[float, float],
    height: float,
    sides: int | None,
    caps: bool,
) -> Mesh:
    """Straight outline, swept, with flat ends if there are `caps`, each in a tile of its own."""
    n_u, n_v = resolution
    columns = round_columns(n_u) if sides is None else flat_columns(n_u, sides)
    low, high = -0.5 * height, 0.5 * height
    side = straight_outline((radii[0], low), (radii[1], high), n_v)
    if not caps:
        return _sweep(columns, side, name)
    outlines = [straight_outline((0.0, low), (radii[0], low), 1), side]
    if radii[1] > 0.0:
        outlines.append(straight_outline((radii[1], high), (0.0, high), 1))
    outline, parts = _joined(outlines)
    return _sweep(columns, outline, name, parts, radii[0])


def _sweep(
    columns: SweptColumns,
    outline: Outline,
    name: str,
    parts: IndexArray | None = None,
    radius: float = 1.0,
) -> Mesh:
    """Sweep an outline through all columns; `parts` (R,): 0 for bottom, 1 for side, 2 for top."""
    grid = make_grid(columns.lines, outline.lines, poles=outline.points[:, 0] == 0.0)
    column, row = grid.nodes[:, 0], grid.nodes[:, 1] // 2
    x, z = columns.points[column].T
    from_axis, heights = outline.points[row].T
    positions = np.stack([from_axis * x, heights, from_axis * z], axis=-1)
    x, z = columns.normals[column].T
    outwards, upwards = outline.normals[row].T
    upwards = columns.inner_radius * upwards  # a flat side is less steep than edges between sides
    normals = np.stack([outwards * x, upwards, outwards * z], axis=-1)
    if columns.inner_radius != 1.0:
        normals /= pm.hypot(outwards, upwards)[:, None]
    uvs = np.stack([columns.u[column], outline.v[row]], axis=-1)
    surface = partial(grid_mesh, grid, name=name, positions=positions, uvs=uvs, normals=normals)
    if parts is None:
        return surface()
    for part, tile, up in (0, 1, 1.0), (2, 2, -1.0):
        of_cap = parts[row] == part
        disk = positions[of_cap][:, [0, 2]] * [1.0, up] / (2.0 * radius)
        uvs[of_cap] = disk + np.array([tile + 0.5, 0.5])
    groups = np.array([1, 0, 2], dtype=np.int32)[parts[row[grid.faces[:, 1]]]]
    names = ("side", "bottom", "top")[: parts.max() + 1]
    return surface(face_groups=groups, group_names=names)


def _joined(outlines: list[Outline]) -> tuple[Outline, IndexArray]:
    """Outlines that go on where the one before ends, with a crease there; and rows' outlines."""
    lines, last = [], 0
    for outline in outlines:
        lines.append(outline.lines + last)
        last += int(outline.lines[-1])
    joined = Outline(
        np.concatenate(lines),
        np.concatenate([outline.points for outline in outlines]),
        np.concatenate([outline.normals for outline in outlines]),
        np.concatenate([outline.v for outline in outlines]),
    )
    return joined, np.repeat(np.arange(len(outlines)), [len(outline.v) for outline in outlines])


def profile_of(source: PathLike | npt.ArrayLike) -> FloatArray:
    """(n, 2) float64 points of a profile, from a file or an array, with radii of 0 or more."""
    points, error, name = numbers_of(source, "profile", _read_profile)
    if points.ndim != 2 or points.shape[1] != 2:
        raise error(f"{name}: an array of shape {points.shape} is not a profile; give (n, 2)")
    if (points[:, 0] < 0.0).any():
        raise error(f"{name}: a radius is negative")
    if len(points) < 2 or (points == points[0]).all():
        raise error(
            f"{name}: it has fewer than two points that differ; a profile needs a radius and "
            "height each"
        )
    if not points[:, 0].any():
        raise error(f"{name}: it lies on the axis; a profile needs a point with a radius above 0")
    return points


def _read_profile(path: PathLike) -> FloatArray:
    rows = [parse_row(path, line, 2, "a point") for line in read_lines(path, "a profile")]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def numbers_of(
    source: PathLike | npt.ArrayLike, name: str, read: Callable[[PathLike], FloatArray]
) -> tuple[FloatArray, type[TexbakeError], PathLike]:
    """Finite numbers of a file or an array, and the type and name for errors about them."""
    if isinstance(source, (str, os.PathLike)):
        return read(source), FileFormatError, source
    try:
        numbers = np.asarray(source, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError(f"{name}: it is not an array of numbers") from error
    if not np.isfinite(numbers).all():
        raise OptionError(f"{name}: a point is not finite")
    return numbers, OptionError, name
