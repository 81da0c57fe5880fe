"""The box as the intermediate surface of a two-part mapping.

It stands about the center, upright along the axis, and holds the whole mesh. Each side has its own
cell of the texture, so that a face may not lie on two of them: one whose corners do is put on the
side that the ray of its centroid meets.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986. It departs in what becomes of a face across an edge of the box, of which they say nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mapping.classical.box import side_pictures
from texbake.mapping.classical.frames import LocalPoints
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import FloatArray, IntArray

SideArray = npt.NDArray[np.int64]

# The box is upright where its pictures have +y up, and +z is the front: e2, axis, e1.
_UPRIGHT = [1, 2, 0]


@dataclass(frozen=True, eq=False)
class Box:
    """A box about the center, with sides across the directions of a frame.

    Attributes
    ----------
    half : (3,) float64
        Half its size: along e2, the axis and e1.
    options : UnwrapOptions
        `size` and `padding` of the texture.
    """

    half: FloatArray
    options: UnwrapOptions
    name: str = "box"

    @classmethod
    def around(cls, local: LocalPoints, faces: IntArray, options: UnwrapOptions) -> Box:
        """Box that reaches as far as the mesh does along each direction, on both sides alike.

        In directions in which the mesh has no extent about the center, it is as long as in that
        in which it is longest; 1 where all of the mesh lies at the center.
        """
        half = np.abs(local.points[faces.ravel()]).max(axis=0)[_UPRIGHT]
        flat = half <= local.rounding
        half[flat] = 1.0 if flat.all() else half.max()
        return cls(half, options)

    def mapped_by_rays(
        self, points: FloatArray, directions: FloatArray, faces: IntArray
    ) -> Projected:
        """Map corners to where rays from them leave the box.

        Parameters
        ----------
        points, directions : (V, 3) float64
            In the frame; starts lie in the box, directions have unit length or none.
        faces : (F, 3) int32

        Returns
        -------
        Projected
            Of a face with corners on several sides, each corner is where its ray meets the plane of
            the side that the face is put on, or the nearest point of that side; without such a ray,
            the foot of the corner on it. So is that of a corner whose ray has no direction.
            Tallied are faces across edges of the box, and corners at the center.
        """
        points, directions = points[:, _UPRIGHT], directions[:, _UPRIGHT]
        corner_sides = self._sides(points, directions)[faces]
        sides = corner_sides[:, 0].copy()
        across = (corner_sides != sides[:, None]).any(axis=1)
        middles = points[faces[across]].mean(axis=1)
        sides[across] = self._sides(middles, _or_outward(directions[faces[across]], middles))

        starts, along = points[faces], directions[faces]
        axes, signs = sides // 2, 1.0 - 2.0 * (sides % 2)
        rows = np.arange(len(faces))
        towards = along[rows, :, axes] * signs[:, None]
        gaps = np.maximum(self.half[axes][:, None] - starts[rows, :, axes] * signs[:, None], 0.0)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            met = starts + (gaps / towards)[:, :, None] * along
        met = np.where((towards > 0.0)[:, :, None] & np.isfinite(met), met, starts)
        met = np.clip(met, -self.half, self.half)

        counts = {
            "faces across an edge of the box": int(across.sum()),
            "corners at the center": int((directions == 0.0).all(axis=1)[faces].sum()),
        }
        return Projected(
            corners=side_pictures(met, sides, self.half, self.options),
            tallies=counts,
        )

    def mapped_by_normals(
        self, points: FloatArray, normals: FloatArray, faces: IntArray
    ) -> Projected:
        """Map corners to their feet on the side of the box whose normal is nearest to the object's.

        Parameters
        ----------
        points, normals : (V, 3) float64
            In the frame.
        faces : (F, 3) int32

        Returns
        -------
        Projected
            A face has one side: that of the sum of its corners' normals; where that is 0, of the
            direction in which it lies from the center.
        """
        corners = points[:, _UPRIGHT][faces]
        chosen = _or_outward(normals[:, _UPRIGHT][faces], corners.mean(axis=1))
        axes = np.abs(chosen).argmax(axis=1)
        sides = 2 * axes + (np.take_along_axis(chosen, axes[:, None], axis=1)[:, 0] < 0.0)
        return Projected(corners=side_pictures(corners, sides, self.half, self.options))

    def _sides(self, points: FloatArray, directions: FloatArray) -> SideArray:
        """(N,) int64: sides on which rays leave the box; without direction, the nearest side."""
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            gaps = np.copysign(self.half, directions) - points
            steps = np.where(directions == 0.0, np.inf, gaps / directions)
        axes = steps.argmin(axis=1)
        ahead = np.take_along_axis(directions, axes[:, None], axis=1)[:, 0]
        none = (directions == 0.0).all(axis=1)
        if none.any():
            axes[none] = (self.half - np.abs(points[none])).argmin(axis=1)
            ahead[none] = np.take_along_axis(points[none], axes[none, None], axis=1)[:, 0]
        return np.asarray(2 * axes + (ahead < 0.0))


def _or_outward(directions: FloatArray, middles: FloatArray) -> FloatArray:
    """(n, 3): sums of the corners' directions; what points outward where nothing is left."""
    sums = directions.sum(axis=1)
    canceled = np.abs(sums).max(axis=1, initial=0.0) <= 2.0**-40  # of unit vectors: rounding
    return np.where(canceled[:, None], middles, sums)
