"""The box as the intermediate surface of a two-part mapping.

It is centered, upright along the axis, and encloses the whole mesh. Each side has its own cell of
the texture, so that a face cannot lie on two of them: a face whose corners do goes to the side that
the ray of its centroid hits.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986, which does not say how to treat a face across an edge of the box.
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

_ROUNDING = 2.0**-40  # of unit vectors, and of distances: of sides as near, the first is taken

# Axes of the box in the frame: its pictures have the axis up and e1 as the front.
_UPRIGHT = [1, 2, 0]


@dataclass(frozen=True, eq=False)
class Box:
    """A box about the center, aligned with a frame."""

    half: FloatArray  # (3,) float64; half its size along e2, the axis and e1
    options: UnwrapOptions  # `size` and `padding` are read
    name: str = "box"

    @classmethod
    def around(cls, local: LocalPoints, faces: IntArray, options: UnwrapOptions) -> Box:
        """The least box about the center that encloses a mesh.

        In directions without extent it is as long as in its longest direction. If the whole mesh
        lies at the center, half its size is 1.
        """
        half = np.abs(local.points[faces.ravel()]).max(axis=0)[_UPRIGHT]
        flat = half <= local.rounding
        half[flat] = 1.0 if flat.all() else half.max()
        return cls(half, options)

    def mapped_by_rays(
        self, points: FloatArray, directions: FloatArray, faces: IntArray
    ) -> Projected:
        """Map corners to where rays from them leave the box.

        `points`, `directions` (V, 3) float64, in the frame; `faces` (F, 3) int32.
        """
        points, directions = points[:, _UPRIGHT], directions[:, _UPRIGHT]
        # A ray along a side must not meet it far away by rounding.
        directions = np.where(np.abs(directions) <= _ROUNDING, 0.0, directions)
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
        """Project corners onto the side of the box whose normal is nearest to the object's.

        `points`, `normals` (V, 3) float64, in the frame; `faces` (F, 3) int32.
        """
        corners = points[:, _UPRIGHT][faces]
        chosen = _or_outward(normals[:, _UPRIGHT][faces], corners.mean(axis=1))
        axes = _first_least(-np.abs(chosen))
        sides = 2 * axes + (np.take_along_axis(chosen, axes[:, None], axis=1)[:, 0] < 0.0)
        return Projected(corners=side_pictures(corners, sides, self.half, self.options))

    def _sides(self, points: FloatArray, directions: FloatArray) -> SideArray:
        """(N,) int64: side where each ray leaves the box; the nearest side without a direction."""
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            gaps = np.copysign(self.half, directions) - points
            steps = np.where(directions == 0.0, np.inf, gaps / directions)
        axes = _first_least(steps)
        ahead = np.take_along_axis(directions, axes[:, None], axis=1)[:, 0]
        none = (directions == 0.0).all(axis=1)
        if none.any():
            gaps = self.half - np.abs(points[none])
            axes[none] = _first_least(gaps, _ROUNDING * self.half.max())
            ahead[none] = np.take_along_axis(points[none], axes[none, None], axis=1)[:, 0]
        return np.asarray(2 * axes + (ahead < 0.0))


def _first_least(values: FloatArray, slack: float = 0.0) -> SideArray:
    """(N,) int64: the first column that is the least of its row but for rounding."""
    least = values.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):  # infinite
        near = values <= least + _ROUNDING * np.abs(least) + slack
    return np.asarray((near | (values == least)).argmax(axis=1))


def _or_outward(directions: FloatArray, middles: FloatArray) -> FloatArray:
    """(n, 3): sums of the corners' directions; the outward direction where they cancel."""
    sums = directions.sum(axis=1)
    canceled = np.abs(sums).max(axis=1, initial=0.0) <= _ROUNDING
    return np.where(canceled[:, None], middles, sums)
