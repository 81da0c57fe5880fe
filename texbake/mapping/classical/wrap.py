"""Angles about an axis as texture coordinates, without smearing any face across the seam.

Where the angle jumps by a whole turn, a face with corners on both sides would run backwards through
the whole texture. So each face has the angle of its own centroid, and each of its corners is taken
on the turn nearest to that: coordinates of a face across the seam pass 0 or 1 a little. The angle
of a point is computed once and moved by whole turns, so that faces that agree on the turn agree
on the coordinate to the last bit.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986 (cylinder and sphere). It says nothing of seams and poles; what they get here is told below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]

# In turns: angles of opposite points differ by half a turn to within this, the rounding of angles.
_ANGLE_ROUNDING = 2.0**-50


@dataclass(frozen=True, kw_only=True, eq=False)
class WrappedAngles:
    """The angles of the corners of faces, each face on one turn.

    Attributes
    ----------
    s : (F, 3) float64
        Texture coordinate: 0 and 1 at the ends of the arc.
    around : (F,) bool
        Faces around the axis: seen along it, the axis passes through them or through the inside
        of an edge. Only these span half a turn or more.
    on_axis : (F, 3) bool
        Corners on the axis.
    """

    s: FloatArray
    around: BoolArray
    on_axis: BoolArray

    def tallies(self, axis: str = "the axis") -> dict[str, int]:
        """What was met, by name; only what there is. `axis` is what the names call it."""
        counts = {
            f"faces around {axis}": int(self.around.sum()),
            f"faces touching {axis}": int(self.on_axis.any(axis=1).sum()),
            "faces along the axis": int(self.on_axis.all(axis=1).sum()),
        }
        return {name: count for name, count in counts.items() if count}


def wrap_angles(
    points: FloatArray, faces: IntArray, *, theta: tuple[float, float], rounding: float
) -> WrappedAngles:
    """Angles of the corners of faces as a texture coordinate, s = (angle - a) / (b - a).

    Parameters
    ----------
    points : (N, 3) float64
        Coordinates along e1, e2 and the axis, as `LocalPoints` has them.
    faces : (F, 3) int32
        Indices into `points`.
    theta : (float, float)
        a and b, in degrees; they differ. b may be the lesser: s then grows clockwise.
    rounding : float
        Points no further than this from the axis are on it.

    Returns
    -------
    WrappedAngles
        The angle of a face's centroid is taken within half a turn of (a + b) / 2, and the angles
        of its corners within half a turn of the centroid's. A corner on the axis gets the angle of
        the centroid (at a pole: a fan); where the centroid is on the axis too, that of the first
        corner that is not; and a face along the axis (a + b) / 2.
    """
    first, last = theta[0] / 360.0, theta[1] / 360.0
    per_turn = 1.0 / (last - first)
    turns = np.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi)
    near = np.hypot(points[:, 0], points[:, 1]) <= rounding
    on_axis = near[faces]
    own = _centroid_turns(points, faces, on_axis, rounding)
    middle = (first + last) / 2.0
    own[on_axis.all(axis=1)] = middle
    own -= np.floor(own - middle + 0.5)

    corner_turns = turns[faces]
    back = np.floor(corner_turns - own[:, None] + 0.5)
    s = ((turns - first) * per_turn)[faces] - back * per_turn
    rows, _ = np.nonzero(on_axis)
    s[on_axis] = (own[rows] - first) * per_turn
    # A triangle around the axis has corners in every half plane; one beside it fits into one.
    corner_turns -= back
    spans = corner_turns.max(axis=1) - corner_turns.min(axis=1)
    around = (spans >= 0.5 - _ANGLE_ROUNDING) & ~on_axis.any(axis=1)
    return WrappedAngles(s=s, around=around, on_axis=on_axis)


def _centroid_turns(
    points: FloatArray, faces: IntArray, on_axis: BoolArray, rounding: float
) -> FloatArray:
    """(F,) float64: angle of each face's centroid, in turns; of a corner where that has none."""
    x, y = (
        points[faces[:, 0], i] + points[faces[:, 1], i] + points[faces[:, 2], i] for i in (0, 1)
    )
    lost = np.flatnonzero(np.hypot(x, y) <= 3.0 * rounding)  # sums of three corners
    off_axis = faces[lost, on_axis[lost].argmin(axis=1)]
    x[lost], y[lost] = points[off_axis, 0], points[off_axis, 1]
    return np.asarray(np.arctan2(y, x) / (2.0 * np.pi))
