"""Charts rotated by several angles, ready to be rasterized at any scale."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.packing.bitmaps import Bitmaps, rasterize_charts
from texbake.mapping.corner_uvs import signed_areas
from texbake.mesh.mesh import FloatArray, IntArray

_STEPS_A_FACE = 30  # steps of work to rasterize a face
_BOX_ANGLES = 90  # angles tried for the least bounding box, one degree apart


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses:
    """Charts, each rotated by K angles of its own."""

    uvs: FloatArray  # (T, K, 2) float64; coordinates in each pose
    corners: FloatArray  # (F, 3, K, 2) float64; coordinates of the faces' corners
    chart_ids: IntArray  # (T,) int32
    face_charts: IntArray  # (F,) int32
    # low, extents: (C, K, 2) float64; lower left corner and size of each chart's bounding box.
    low: FloatArray
    extents: FloatArray

    @classmethod
    def turned(
        cls, uvs: FloatArray, faces: IntArray, chart_ids: IntArray, angles: FloatArray
    ) -> Poses:
        """Poses of charts rotated counter-clockwise by `angles` (C, K), in radians."""
        cos, sin = pm.cos(angles)[chart_ids], pm.sin(angles)[chart_ids]
        x, y = uvs[:, :1], uvs[:, 1:]
        posed = np.stack([x * cos - y * sin, x * sin + y * cos], axis=2)
        order = np.argsort(chart_ids, kind="stable")
        starts = np.searchsorted(chart_ids[order], np.arange(len(angles)))
        low = np.minimum.reduceat(posed[order], starts)
        return cls(
            uvs=posed,
            corners=np.ascontiguousarray(posed[faces]),
            chart_ids=chart_ids,
            face_charts=np.ascontiguousarray(chart_ids[faces[:, 0]]),
            low=low,
            extents=np.maximum.reduceat(posed[order], starts) - low,
        )

    def lengths(self) -> FloatArray:
        """(C,) float64: longer side of each chart's box, in the pose in which it is shortest."""
        return np.asarray(self.extents.max(axis=2).min(axis=1))

    @property
    def work(self) -> int:
        """Steps of work to rasterize them."""
        return self.corners.size // 6 * _STEPS_A_FACE

    def bitmaps(self, scale: float, margin: float) -> Bitmaps:
        """Bitmaps at a scale, in cells per unit, of charts enlarged by `margin` cells."""
        return rasterize_charts(
            self.corners, self.face_charts, self.low, self.extents, scale=scale, margin=margin
        )

    def placed_uvs(self, bitmaps: Bitmaps, scale: float, places: IntArray) -> FloatArray:
        """(T, 2) float64: coordinates, in cells of the grid, of charts at `places` (C, 4)."""
        corner, pose, turns = (places[self.chart_ids][:, part] for part in (slice(2), 2, 3))
        shifts = bitmaps.shifts[self.chart_ids, pose]
        x, y = (self.uvs[np.arange(len(pose)), pose] * scale + shifts).T
        width, height = bitmaps.boxes[self.chart_ids, pose].T
        turned = (
            np.choose(turns, [x, height - y, width - x, y]),
            np.choose(turns, [y, x, height - y, width - x]),
        )
        return np.asarray(np.stack(turned, axis=1) + corner)


@dataclass(frozen=True, kw_only=True, eq=False)
class Outlines:
    """Charts to be packed, in the pose that all angles are relative to."""

    uvs: FloatArray
    faces: IntArray
    chart_ids: IntArray
    n_charts: int

    def areas(self) -> FloatArray:
        """(C,) float64: area of each chart."""
        charts = self.chart_ids[self.faces[:, 0]]
        areas = np.abs(signed_areas(self.uvs[self.faces]))
        return np.asarray(np.bincount(charts, areas, minlength=self.n_charts), dtype=np.float64)

    def upright(self, angles: FloatArray) -> Outlines:
        """Rotate each chart permanently by an angle (C,)."""
        return replace(self, uvs=self.turned(angles[:, None]).uvs[:, 0])

    def turned(self, angles: FloatArray) -> Poses:
        """Poses at `angles` (C, K)."""
        return Poses.turned(self.uvs, self.faces, self.chart_ids, angles)


def least_box_angles(uvs: FloatArray, chart_ids: IntArray) -> FloatArray:
    """(C,) float64: rotation of each chart, in radians, with the least area of the bounding box.

    It is one of 90 angles, the first of equally good ones.

    Kernel: `core/chart_bitmaps.c`.
    """
    order = np.argsort(chart_ids, kind="stable")
    n_charts = int(chart_ids.max()) + 1
    starts = np.searchsorted(chart_ids[order], np.arange(n_charts + 1))
    angles = np.arange(_BOX_ANGLES) * (math.pi / 2.0 / _BOX_ANGLES)
    best = np.zeros(n_charts, dtype=np.int64)
    core.find_least_boxes(uvs[order], starts, pm.cos(angles), pm.sin(angles), best)
    return np.asarray(angles[best])
