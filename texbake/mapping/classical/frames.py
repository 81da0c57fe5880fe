"""The frame of a mapping: its axis and center, vertices seen from there, angles about the axis.

A frame is three perpendicular unit vectors, right-handed, as rows: e1, the direction of angle 0;
e2, the direction of a quarter turn; and the axis. docs/explanation/mappings.md has the frames of
the axes, and says how a face runs across the seam. Points are moved to the center in float64 and
scaled by a power of two, so that the size and position of a model change no more than the last bits
of the result. The angle of a point is computed once and moved by whole turns, so that faces on the
same turn agree to the last bit.

Based on: the rotation that takes one unit vector to another without twist, after O. Rodrigues,
1840; Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9), 1986
(cylinder and sphere; seams and poles, which it leaves open, are as `wrap_angles` says).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.options.projection import AXES
from texbake.mapping.options.shared import Vector
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh, frozen
from texbake.records import dataclass

# As a share of the largest coordinate: half a unit in the last place for the coordinate, the
# center, their difference, and each step of the rotation into the frame.
_ROUNDING = 8.0 * 2.0**-53


# In turns: the rounding of angles, by which opposite points may miss half a turn.
_ANGLE_ROUNDING = 2.0**-50


@dataclass(frozen=True, eq=False)
class LocalPoints:
    """The vertices of a mesh relative to a center, in a frame."""

    # (V, 3) float64; coordinates along e1, e2 and the axis, multiplied by `scale`.
    points: FloatArray
    scale: float  # local units per model unit, a power of two
    # How far, in local units, a point may be from its intended position, because its coordinates
    # and the center are rounded. A point no farther from the axis lies on it.
    rounding: float


def frame_about(axis: str | Vector) -> FloatArray:
    """(3, 3) rows e1, e2 and the axis; of a vector the nearest frame of an axis, turned onto it."""
    vector = _unit(AXES[axis] if isinstance(axis, str) else axis)
    nearest = int(np.abs(vector).argmax())
    frame = np.roll(np.eye(3), -1 - nearest, axis=0)  # rows nearest + 1, nearest + 2, nearest
    if vector[nearest] < 0.0:
        frame[1:] *= -1.0
    cross = np.cross(frame[2], vector)
    # Rodrigues: v + cross x v + cross x (cross x v) / (1 + cos), where cos is at least 3^-1/2.
    turned = np.cross(cross, frame)
    turned = frame + turned + np.cross(cross, turned) / (1.0 + pm.matmul(frame[2], vector))
    return frozen(turned + 0.0)


def upright_frame(normal: npt.ArrayLike) -> FloatArray:
    """(3, 3) rows right, up and `normal`, to the viewer; up is closest to +y, or else -z or +z."""
    vector = _unit(normal)
    right = np.array([vector[2], 0.0, -vector[0]])  # +y x normal
    if pm.hypot(right[0], right[2]) <= _ROUNDING:
        right = np.array([1.0, 0.0, 0.0])
    right = _unit(right)
    return frozen(np.array([right, np.cross(vector, right), vector]) + 0.0)


def center_of(mesh: Mesh, center: Vector | None) -> FloatArray:
    """(3,) float64: the given center; None for the center of the bounding box."""
    if center is not None:
        return frozen(np.array(center, dtype=np.float64))
    low, high = mesh.bounds / 2.0  # halved first: the sum of large coordinates overflows
    return frozen(low + high)


def in_frame(vectors: FloatArray, rows: FloatArray) -> FloatArray:
    """(..., K) components of vectors along rows (K, 3), summed in order, unlike matrix products."""
    x, y, z = (vectors[..., i] for i in range(3))
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in rows], axis=-1)


def points_about(mesh: Mesh, center: npt.ArrayLike, frame: FloatArray) -> LocalPoints:
    """Vertices relative to a center (3,), in model units, in a frame (3, 3) of `frame_about`."""
    middle = np.asarray(center, dtype=np.float64)
    largest = float(max(np.abs(mesh.bounds).max(), np.abs(middle).max()))
    scale = unit_scale(largest)
    with np.errstate(over="ignore", invalid="ignore"):  # from vertices that no face uses
        moved = mesh.positions * scale - middle * scale
        # Removes -0.0, whose angle would be -pi where that of 0.0 is pi.
        points = in_frame(moved, frame) + 0.0
    return LocalPoints(points, scale, _ROUNDING * (largest * scale))


def _unit(vector: npt.ArrayLike) -> FloatArray:
    """(3,) float64: a nonzero vector, normalized."""
    values = np.asarray(vector, dtype=np.float64)
    values = values / np.abs(values).max()  # so that squares neither overflow nor vanish
    return np.asarray(values / pm.norm(values))


@dataclass(frozen=True, kw_only=True, eq=False)
class WrappedAngles:
    """The angles of the corners of faces, each face on one turn."""

    s: FloatArray  # (F, 3) float64; texture coordinate, 0 and 1 at the ends of the arc
    # (F,) bool; faces around the axis: the axis passes through them or through one of their edges.
    # Only these span half a turn or more.
    around: BoolArray
    on_axis: BoolArray  # (F, 3) bool; corners on the axis

    def tallies(self, axis: str = "the axis") -> dict[str, int]:
        """Counts of special cases by name, without zeros; `axis` is what the names call it."""
        counts = {
            f"faces around {axis}": int(self.around.sum()),
            f"faces touching {axis}": int(self.on_axis.any(axis=1).sum()),
            "faces along the axis": int(self.on_axis.all(axis=1).sum()),
        }
        return {name: count for name, count in counts.items() if count}


def wrap_angles(
    points: FloatArray,
    faces: IntArray,
    *,
    theta: tuple[float, float],
    rounding: float,
    polygons: IntArray | None = None,
) -> WrappedAngles:
    """Angles of the corners of faces as s = (angle - a) / (b - a), with `theta` a and b in degrees.

    A corner within `rounding` of the axis gets the angle of its face's centroid, which makes a fan
    at a pole. A whole polygon is on one turn, unless it surrounds the axis.
    """
    first, last = theta[0] / 360.0, theta[1] / 360.0
    per_turn = 1.0 / (last - first)
    turns = pm.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi)
    near = pm.hypot(points[:, 0], points[:, 1]) <= rounding
    on_axis = near[faces]
    own = _centroid_turns(points, turns, faces, on_axis, rounding)
    if polygons is not None:
        own = _polygon_turns(points, turns, faces, polygons, own, on_axis)
    middle = (first + last) / 2.0
    own[on_axis.all(axis=1)] = middle
    own -= np.floor(own - middle + 0.5)

    corner_turns = turns[faces]
    back = np.floor(corner_turns - own[:, None] + 0.5)
    s = ((turns - first) * per_turn)[faces] - back * per_turn
    rows, _ = np.nonzero(on_axis)
    s[on_axis] = (own[rows] - first) * per_turn
    # A triangle around the axis has corners in every half-plane; any other fits into one.
    corner_turns -= back
    spans = corner_turns.max(axis=1) - corner_turns.min(axis=1)
    around = (spans >= 0.5 - _ANGLE_ROUNDING) & ~on_axis.any(axis=1)
    return WrappedAngles(s=s, around=around, on_axis=on_axis)


def _polygon_turns(
    points: FloatArray,
    turns: FloatArray,
    faces: IntArray,
    polygons: IntArray,
    own: FloatArray,
    on_axis: BoolArray,
) -> FloatArray:
    """(F,) float64: turn of the polygon of each face; `own` if it spans half a turn or more."""
    corners = points[faces].sum(axis=1)
    x, y = (np.bincount(polygons, corners[:, axis])[polygons] for axis in (0, 1))
    whole = pm.arctan2(y, x) / (2.0 * np.pi)
    away = turns[faces] - whole[:, None]
    away -= np.floor(away + 0.5)
    low = np.full(int(polygons.max(initial=-1)) + 1, np.inf)
    high = -low
    np.minimum.at(low, polygons, np.where(on_axis, np.inf, away).min(axis=1))
    np.maximum.at(high, polygons, np.where(on_axis, -np.inf, away).max(axis=1))
    fits = high - low < 0.5 - _ANGLE_ROUNDING
    return np.asarray(np.where(fits[polygons], whole, own))


def _centroid_turns(
    points: FloatArray, turns: FloatArray, faces: IntArray, on_axis: BoolArray, rounding: float
) -> FloatArray:
    """(F,) float64: angle of each face's centroid in turns; of a corner if that has none."""
    x, y = (
        points[faces[:, 0], i] + points[faces[:, 1], i] + points[faces[:, 2], i] for i in (0, 1)
    )
    lost = np.flatnonzero(pm.hypot(x, y) <= 3.0 * rounding)  # rounding in a sum of three corners
    own = pm.arctan2(y, x) / (2.0 * np.pi)
    # Whichever corner of the face is its first.
    own[lost] = np.where(on_axis[lost], np.inf, turns[faces[lost]]).min(axis=1)
    return np.asarray(own)
