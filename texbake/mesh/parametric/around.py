"""Columns of a surface about the y axis: round or with flat sides, for a whole turn or a part.

The angle a grows counter-clockwise seen from above, and is 0 at the front, +z, where u is 1/2; a
whole turn has its seam at the back. So `texbake unwrap --method cylindrical` and `spherical` give
such a surface the coordinates that it has from here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.parametric.circle import circle_points
from texbake.mesh.parametric.grid import closed_lines, half_steps, open_lines, part_way


@dataclass(frozen=True, kw_only=True, eq=False)
class Columns:
    """Where the columns of a surface about the y axis stand.

    Attributes
    ----------
    lines : (C,) int32
        As `make_grid` takes them.
    u : (2 C - 1,) float64
        At half steps.
    points : (2 C - 1, 2) float64
        (x, z) where the radius is 1.
    normals : (2 C - 1, 2) float64
        (x, z) of the unit normal of the upright surface.
    inner_radius : float
        Distance of the axis from the middle of a flat side, where the radius is 1; 1 where the
        surface is round.
    """

    lines: IntArray
    u: FloatArray
    points: FloatArray
    normals: FloatArray
    inner_radius: float = 1.0


def round_columns(n_columns: int, turns: float = 1.0) -> Columns:
    """Columns evenly spaced on a circle, or on the front part of it."""
    steps = np.arange(2 * n_columns + 1)
    if turns == 1.0:
        points = _xz(circle_points(2 * n_columns)[(steps + n_columns) % (2 * n_columns)])
        lines = closed_lines(n_columns)
    else:
        angles = np.pi * turns / n_columns * (steps - n_columns)
        points = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
        lines = open_lines(n_columns)
    return Columns(lines=lines, u=steps / (2 * n_columns), points=points, normals=points)


def flat_columns(n_columns: int, sides: int) -> Columns:
    """Columns on a regular polygon, at least as many as asked for, evenly spaced on its sides.

    A corner is at the seam. At each corner there are two columns with normals of their own.
    """
    per_side = -(-n_columns // sides)
    n_columns = sides * per_side
    side, step = (axis.ravel() for axis in np.indices((sides, per_side + 1)))
    numbers = side * per_side + step
    # The seam, u = 0, is at the back: half a turn from where the angle is 0.
    corners = -_xz(circle_points(sides))
    middles = -_xz(circle_points(2 * sides)[1::2])
    points = part_way(corners[side], corners[(side + 1) % sides], step[:, None], per_side)
    return Columns(
        lines=(numbers % n_columns).astype(np.int32),
        u=half_steps(numbers / n_columns),
        points=half_steps(points),
        normals=half_steps(middles[side]),
        inner_radius=float(np.cos(np.pi / sides)),
    )


def _xz(points: FloatArray) -> FloatArray:
    """Turn (cosine, sine) of angles about y, counted from z, into (x, z)."""
    return points[:, ::-1]
