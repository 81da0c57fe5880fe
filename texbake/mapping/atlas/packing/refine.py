"""Overlapping charts moved apart on the exact grid of texels, rotated slightly, and enlarged."""

from __future__ import annotations

import math

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.packing.bitmaps import (
    Bitmaps,
    ChartRotations,
    Outlines,
    PackingGrid,
    Shapes,
    shapes_of,
)
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.records import dataclass

# Texels by which charts are enlarged: half of the 1/256 texel that rasterizers snap to, which is
# also more than a float32 file loses of a coordinate.
SNAP_MARGIN = 1.0 / 512.0

_ANGLES = np.radians([0.0, 1.5, -1.5, 5.0, -5.0])  # rotations to try at each scale
_STEP, _LEAST_STEP = 0.004, 0.001  # relative steps of the scale while charts grow
_FIRST_STEP = 0.008  # relative step of the scale while charts must shrink
_HASTE = 5  # greatest multiple of it, as the work exceeds its limit
_MOST_SHRINKS = 40

_BASE_WEIGHT = 2048.0  # of an overlapping cell; weights are integer fractions of it


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """How long and how far charts search for places."""

    samples: int  # places that a move samples before it follows the best ones downhill
    radius: int  # farthest that most moves go, in cells
    step: int  # first step downhill, in cells
    patience: int  # sweeps over the charts without progress after which the search ends
    # Steps after which the search ends: a measure of time that is the same on every machine.
    work: int


_SEARCH = SearchLimits(samples=24, radius=12, step=4, patience=80, work=300_000_000)


def pair_weights(areas: FloatArray) -> IntArray:
    """(C, C) cost of an overlapping cell, by areas in cells; higher for small charts."""
    sides = np.sqrt(np.minimum.outer(areas, areas) + 1.0)
    return np.asarray(np.clip(_BASE_WEIGHT / sides, 8.0, 2048.0), dtype=np.int32)


def separate(
    shapes: Shapes,
    places: IntArray,
    weights: IntArray,
    *,
    size: tuple[int, int],
    search: SearchLimits,
    seed: int,
) -> tuple[IntArray, int, int]:
    """Least overlap: (C, 3) column, row, orientation; cells; work. `core/guided_local_search.c`."""
    best_places = places.copy()
    work = np.empty(1, dtype=np.int64)
    overlap = core.separate_charts(
        *shapes, places.copy(), weights, weights.copy(), size[1], size[0],
        search.samples, search.radius, search.step, search.patience, search.work, seed,
        best_places, work,
    )  # fmt: skip
    return best_places, overlap, int(work[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughLayout:
    """Approximate positions of charts."""

    angles: FloatArray  # (C,) float64; rotation of each chart in radians
    # (C, 2) float64; center of its bounding box, as a share of the width and height between the
    # borders.
    centers: FloatArray
    scale: float  # texels per unit
    fixed: BoolArray  # (C,); charts that keep their angles
    value: float  # the scale, with a bonus for mirrored pairs and neighbors near each other


@dataclass(frozen=True, kw_only=True, eq=False)
class FinalLayout:
    """Charts at exact places on the cells of a grid, at a scale in cells per unit."""

    poses: ChartRotations
    bitmaps: Bitmaps
    places: IntArray
    scale: float

    def uvs(self) -> FloatArray:
        """(T, 2) float64: coordinates in cells."""
        return self.poses.placed_uvs(self.bitmaps, self.scale, self.places)

    def layout(self, grid: PackingGrid, angles: FloatArray) -> RoughLayout:
        """The layout without its cells; `angles` (C, K) are those of the poses."""
        charts = np.arange(len(self.places))
        pose, turns = self.places[:, 2], self.places[:, 3]
        boxes = self.bitmaps.boxes[charts, pose]
        boxes = np.where(turns[:, None] % 2 == 0, boxes, boxes[:, ::-1])
        return RoughLayout(
            angles=angles[charts, pose] + turns * (math.pi / 2.0),
            centers=(self.places[:, :2] + boxes / 2.0) / [grid.width, grid.height],
            scale=self.scale * grid.cell,
            fixed=np.zeros(len(charts), dtype=bool),
            value=self.scale * grid.cell,
        )


def refine_layout(
    charts: Outlines, layout: RoughLayout, grid: PackingGrid, *, most_work: int, seed: int
) -> FinalLayout | None:
    """Move charts to exact places near a layout, at the largest scale; None if none works."""
    areas = charts.areas
    best: FinalLayout | None = None
    best_layout, step, n_failed, work, trial = layout, _STEP, 0, 0, 0
    scale = layout.scale / grid.cell
    turns = np.where(layout.fixed[:, None], 0.0, charts.allowed(_ANGLES))
    while (best is None or work < most_work) and step >= _LEAST_STEP:
        trial += 1
        angles = layout.angles[:, None] + turns
        result, overlap, steps = _moved_apart(
            charts, angles, layout.centers, areas, grid, scale, seed + trial
        )
        work += steps
        if result is not None:
            layout = result.layout(grid, angles)
        if overlap == 0:
            best, best_layout, n_failed = result, layout, 0
            scale *= 1.0 + step
        elif best is None:
            if trial > _MOST_SHRINKS:
                return None
            scale /= 1.0 + _FIRST_STEP * min(1 + work // most_work, _HASTE)
        else:
            n_failed += 1
            if n_failed == 3 or result is None:
                step, n_failed, layout = step / 2.0, 0, best_layout
                scale = best.scale * (1.0 + step)
    return best


def _moved_apart(
    charts: Outlines,
    angles: FloatArray,
    centers: FloatArray,
    areas: FloatArray,
    grid: PackingGrid,
    scale: float,
    seed: int,
) -> tuple[FinalLayout | None, int, int]:
    """Separate charts near centers; return places, None if too large, overlap and work."""
    poses = charts.turned(angles)
    work = poses.work
    bitmaps = poses.bitmaps(scale, SNAP_MARGIN / grid.cell)
    room = np.array([grid.width, grid.height]) - bitmaps.boxes[:, 0]
    if (room < 0).any():
        return None, 1, work
    shapes = shapes_of(bitmaps, grid.half_widths, turns=1)
    places = np.zeros((charts.n_charts, 3), dtype=np.int32)
    middle = centers * [grid.width, grid.height] - bitmaps.boxes[:, 0] / 2.0
    places[:, :2] = np.clip(np.rint(middle), 0, room)
    places, overlap, steps = separate(
        shapes,
        places,
        pair_weights(areas * scale**2),
        size=(grid.width, grid.height),
        search=_SEARCH,
        seed=seed,
    )
    places = np.concatenate([places, np.zeros_like(places[:, :1])], axis=1)
    result = FinalLayout(poses=poses, bitmaps=bitmaps, places=places, scale=scale)
    return result, overlap, work + steps + grid.width * grid.height // 4
