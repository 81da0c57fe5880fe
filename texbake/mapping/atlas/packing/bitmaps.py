"""Charts rotated by several angles, and on a grid of cells: as bitmaps, and as runs of cells."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.neighbors import Neighbors
from texbake.mapping.corner_uvs import signed_areas
from texbake.mesh.mesh import BoolArray, ByteArray, FloatArray, Int64Array, IntArray
from texbake.mesh.topology import opposite_half_edges
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True)
class PackingGrid:
    """The cells of a texture inside its borders, and how far apart charts are kept on them."""

    # width, height: number of columns and rows.
    width: int
    height: int
    cell: int  # texels along the side of a cell
    # (2 r + 1,) int32; for the rows -r to r relative to a cell that a chart touches: how many cells
    # on each side of its column another chart may not touch.
    half_widths: IntArray

    @classmethod
    def over(cls, size: tuple[int, int], padding: int, *, most_cells: int) -> PackingGrid:
        """Grid of a texture of at most `most_cells` each way, `padding` texels off the borders."""
        cell = -(-max(size) // most_cells)
        width, height = ((length - 2 * padding) // cell for length in size)
        steps = np.arange(2 * padding // cell + 2)
        # Distance of the nearest texel centers of two cells, by steps along one axis.
        texels = np.where(steps > 0, steps * cell - (cell - 1), 0)
        # Centers 2 padding apart are too near: both paddings would cover the texel between them.
        near = texels[:, None] ** 2 + texels[None, :] ** 2 <= (2 * padding) ** 2
        counts = near.sum(axis=1)[near.any(axis=1)].astype(np.int32) - 1
        half_widths = np.concatenate([counts[:0:-1], counts])
        return cls(width=width, height=height, cell=cell, half_widths=half_widths)


@dataclass(frozen=True, kw_only=True, eq=False)
class Bitmaps:
    """The cells that charts touch, at one scale and in several poses (rotations)."""

    boxes: Int64Array  # (C, K, 2) int64; columns and rows of the bitmap of each chart and pose
    # (C, K, 2) float64; offset of the scaled coordinates that centers them in the bitmap.
    shifts: FloatArray
    starts: Int64Array  # (C, K) int64; where each bitmap, stored row by row, begins in `masks`
    masks: ByteArray  # (sum of columns times rows,) uint8; 1 where a cell is touched


class Shapes(NamedTuple):
    """The cells of charts in O orientations, as runs along rows."""

    boxes: IntArray  # (C, O, 2) int32; columns and rows of each chart in each orientation
    # (S, 3) int32; row, begin and end of each run, grouped by chart and orientation, in the order
    # of rows.
    spans: IntArray
    # (C, O, 2) int64; where the runs of each chart and orientation begin and end in `spans`.
    starts: Int64Array
    # reach, reach_starts: (R, 3) int32 and (C, O, 2) int64; the same for the cells that no other
    # chart may touch.
    reach: IntArray
    reach_starts: Int64Array
    margin: int  # cells by which these extend beyond the box of the chart


def shapes_of(bitmaps: Bitmaps, half_widths: IntArray, *, turns: int) -> Shapes:
    """Runs of charts in `turns` quarter turns of each pose, by `core/chart_bitmaps.c`."""
    n_charts, n_poses = bitmaps.starts.shape
    boxes = np.repeat(bitmaps.boxes, turns, axis=1).astype(np.int32)
    boxes[:, 1::2] = boxes[:, 1::2, ::-1] if turns > 1 else boxes[:, 1::2]
    # A row of n cells holds at most (n + 1) / 2 runs, and a run at least one marked cell.
    in_rows = (boxes[..., 0].astype(np.int64) + 1) // 2 * boxes[..., 1]
    masks = np.split(bitmaps.masks, bitmaps.starts.ravel()[1:])
    marked = np.repeat([np.count_nonzero(mask) for mask in masks], turns)
    most = int(np.minimum(in_rows.ravel(), marked).sum())
    spans = np.empty((most, 3), dtype=np.int32)
    starts = np.empty((n_charts, n_poses * turns, 2), dtype=np.int64)
    n_spans = core.list_spans(bitmaps.masks, bitmaps.starts, bitmaps.boxes, turns, spans, starts)
    spans = spans[:n_spans].copy()
    margin = len(half_widths) // 2
    if margin == 0:
        return Shapes(boxes, spans, starts, spans, starts, 0)
    # Dilation joins runs and adds none except in new rows, which have no more than their neighbor.
    reach = np.empty((n_spans * (2 * margin + 1), 3), dtype=np.int32)
    reach_starts = np.empty_like(starts)
    n_reach = core.list_reach(spans, starts, boxes, half_widths, reach, reach_starts)
    return Shapes(boxes, spans, starts, reach[:n_reach].copy(), reach_starts, margin)


_STEPS_A_FACE = 30  # steps of work to rasterize a face
_BOX_ANGLES = 90  # angles tried for the least bounding box, one degree apart
_QUARTER = math.pi / 2.0
_ONE_DIRECTION = math.radians(2.0)  # between border edges that count as parallel or perpendicular
_LEAST_SHARE = 0.5  # of its border in one direction, for a chart to lie along it
_WHOLE = 0.98  # share of the border of a chart that is straight all around
_WEIGHTS = 2.0**30  # steps of a share of the border, which add up without rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartRotations:
    """Charts, each rotated by K angles of its own."""

    uvs: FloatArray  # (T, K, 2) float64; coordinates in each pose
    charts: Outlines
    # low, extents: (C, K, 2) float64; lower left corner and size of each chart's bounding box.
    low: FloatArray
    extents: FloatArray

    @classmethod
    def of(cls, charts: Outlines, angles: FloatArray) -> ChartRotations:
        """Rotate charts counter-clockwise by `angles` (C, K), in radians."""
        chart_ids = charts.chart_ids
        cos, sin = pm.cos(angles)[chart_ids], pm.sin(angles)[chart_ids]
        x, y = charts.uvs[:, :1], charts.uvs[:, 1:]
        posed = np.stack([x * cos - y * sin, x * sin + y * cos], axis=2)
        order = np.argsort(chart_ids, kind="stable")
        starts = np.searchsorted(chart_ids[order], np.arange(len(angles)))
        low = np.minimum.reduceat(posed[order], starts)
        extents = np.maximum.reduceat(posed[order], starts) - low
        return cls(uvs=posed, charts=charts, low=low, extents=extents)

    def lengths(self) -> FloatArray:
        """(C,) float64: longer side of each chart's box, in the pose in which it is shortest."""
        return np.asarray(self.extents.max(axis=2).min(axis=1))

    @property
    def work(self) -> int:
        """Steps of work to rasterize them."""
        n_poses = int(self.uvs.shape[1])
        return len(self.charts.faces) * n_poses * _STEPS_A_FACE

    def bitmaps(self, scale: float, margin: float) -> Bitmaps:
        """Cells, `scale` per unit, that charts touch in each pose, enlarged by `margin` cells.

        From -0.5 up, those whose centers lie within `margin + 0.5` along both axes; one at least.
        Kernel: `core/chart_bitmaps.c`.
        """
        boxes, shifts = self.frames(scale, margin)
        n_cells = boxes.prod(axis=2)
        starts = np.cumsum(n_cells.ravel()).reshape(n_cells.shape) - n_cells
        masks = np.zeros(n_cells.sum(), dtype=np.uint8)
        core.mark_charts(
            self.uvs, self.charts.chart_ids, *self.charts.drawn, scale, shifts, margin, boxes,
            starts, masks,
        )  # fmt: skip
        # Not their sum, for which all cells would be copied into larger numbers.
        empty = np.maximum.reduceat(masks, starts.ravel()) == 0
        masks[starts.ravel()[empty]] = 1
        return Bitmaps(boxes=boxes, shifts=shifts, starts=starts, masks=masks)

    def frames(self, scale: float, margin: float) -> tuple[Int64Array, FloatArray]:
        """The `boxes` and `shifts` of their bitmaps."""
        boxes = np.maximum(np.ceil(self.extents * scale + 2.0 * margin), 1.0).astype(np.int64)
        return boxes, (boxes - self.extents * scale) / 2.0 - self.low * scale

    def placed_uvs(self, bitmaps: Bitmaps, scale: float, places: IntArray) -> FloatArray:
        """(T, 2) float64: coordinates, in cells of the grid, of charts at `places` (C, 4)."""
        chart_ids = self.charts.chart_ids
        corner, pose, turns = (places[chart_ids][:, part] for part in (slice(2), 2, 3))
        shifts = bitmaps.shifts[chart_ids, pose]
        x, y = (self.uvs[np.arange(len(pose)), pose] * scale + shifts).T
        width, height = bitmaps.boxes[chart_ids, pose].T
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
    aligned: BoolArray | None = None  # (C,); charts that are only rotated by quarter turns
    neighbors: Neighbors | None = None

    def allowed(self, angles: npt.NDArray[np.floating]) -> FloatArray:
        """(C, K) `angles`, in radians, 0 for aligned charts; K = 1 if all charts are."""
        aligned = np.zeros(self.n_charts, dtype=bool) if self.aligned is None else self.aligned
        return np.where(aligned[:, None], 0.0, angles[:1] if aligned.all() else angles)

    def along_axes(self, longest: float) -> Outlines:
        """Rotate charts, so that straight borders lie along u and v, or into their least boxes.

        Charts that are then longer than `longest` are not aligned, unless their whole border is.
        """
        angles, shares = border_angles(self)
        lengths = self.turned(-angles[:, None]).extents[:, 0].max(axis=1)
        aligned = (shares > _LEAST_SHARE) & ((lengths <= longest) | (shares > _WHOLE))
        least = least_box_angles(self.uvs, self.chart_ids)
        turned, pairs = np.where(aligned, -angles, least), self.neighbors
        if pairs is not None:
            pairs, turned = pairs.mirrored(turned, aligned)
        return replace(self.upright(turned), aligned=aligned, neighbors=pairs)

    @cached_property
    def areas(self) -> FloatArray:
        """(C,) float64: area of each chart."""
        charts = self.chart_ids[self.faces[:, 0]]
        areas = np.abs(signed_areas(self.uvs[self.faces]))
        return np.asarray(np.bincount(charts, areas, minlength=self.n_charts), dtype=np.float64)

    def upright(self, angles: FloatArray) -> Outlines:
        """Rotate each chart permanently by an angle (C,)."""
        return replace(self, uvs=self.turned(angles[:, None]).uvs[:, 0])

    def turned(self, angles: FloatArray) -> ChartRotations:
        """Rotations by `angles` (C, K)."""
        return ChartRotations.of(self, angles)

    @cached_property
    def drawn(self) -> tuple[IntArray, IntArray]:
        """Triangles (S, 3) of charts with mirrored ones, borders (B, 2) of others, by chart."""
        charts = self.chart_ids[self.faces[:, 0]]
        areas = signed_areas(self.uvs[self.faces])
        solid = (self.faces != np.roll(self.faces, 1, axis=1)).all(axis=1)
        some_left, some_right = (
            np.bincount(charts, solid & side) > 0.0 for side in (areas >= 0.0, areas <= 0.0)
        )
        folded = (some_left & some_right)[charts]
        is_open = (opposite_half_edges(self.faces) < 0).reshape(-1, 3) & ~folded[:, None]
        edges = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2)[is_open]
        order = np.argsort(self.chart_ids[edges[:, 0]], kind="stable")
        return self.faces[folded], edges[order]


def least_box_angles(uvs: FloatArray, chart_ids: IntArray) -> FloatArray:
    """(C,) radians, of 90 angles, with the least bounding box; `core/chart_bitmaps.c`."""
    order = np.argsort(chart_ids, kind="stable")
    n_charts = int(chart_ids.max()) + 1
    starts = np.searchsorted(chart_ids[order], np.arange(n_charts + 1))
    angles = np.arange(_BOX_ANGLES) * (math.pi / 2.0 / _BOX_ANGLES)
    best = np.zeros(n_charts, dtype=np.int64)
    core.find_least_boxes(uvs[order], starts, pm.cos(angles), pm.sin(angles), best)
    return np.asarray(angles[best])


def border_angles(charts: Outlines) -> tuple[FloatArray, FloatArray]:
    """(C,) radians: direction of most of each chart's border, modulo quarter turns; 0 without one.

    Also returns (C,): share of the border within 2° of that direction or the one across.
    """
    edges = charts.drawn[1]
    steps = charts.uvs[edges[:, 1]] - charts.uvs[edges[:, 0]]
    lengths = pm.norm(steps, axis=1)
    edges, steps, lengths = (each[lengths > 0.0] for each in (edges, steps, lengths))
    owners = charts.chart_ids[edges[:, 0]]
    borders = np.bincount(owners, lengths, minlength=charts.n_charts)
    weights = np.rint(lengths / borders[owners] * _WEIGHTS).astype(np.int64)
    # Each edge twice, a quarter turn apart, for windows of directions on both sides of an axis.
    turned = pm.arctan2(steps[:, 1], steps[:, 0]) % _QUARTER
    directions, ids = np.concatenate([turned, turned + _QUARTER]), np.tile(owners, 2)
    order = np.lexsort((directions, ids))
    directions, ids = directions[order], ids[order]
    sums = np.concatenate([[0], np.cumsum(np.tile(weights, 2)[order])])
    keys = ids * 4.0 + directions
    shares = sums[np.searchsorted(keys, keys + _ONE_DIRECTION, side="right")] - sums[:-1]
    with_border, firsts = np.unique(ids, return_index=True)
    starts = np.lexsort((-shares, ids))[firsts]
    # The direction of an edge: half of the window points to one side of it, half to the other.
    middle = np.searchsorted(sums, sums[starts] + shares[starts] // 2, side="right") - 1
    angles, along = np.zeros(charts.n_charts), np.zeros(charts.n_charts)
    angles[with_border], along[with_border] = directions[middle], shares[starts] / _WEIGHTS
    return angles, along
