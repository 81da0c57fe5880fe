"""Charts on a grid of cells: as bitmaps, and as runs of cells with the distance to keep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.mapping.kernels.chart_bitmaps import mask_kernel, reach_kernel, spans_kernel
from texbake.mesh.mesh import FloatArray, IntArray

LongArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Cells between the borders of a texture, and how far apart two charts are kept on them.

    Attributes
    ----------
    width, height : int
        Cells in a row, and rows.
    cell : int
        Texels along the side of a cell.
    half_widths : (2 r + 1,) int32
        For rows -r to r from a cell that a chart touches: how many cells to either side of its
        column another chart may not touch.
    """

    width: int
    height: int
    cell: int
    half_widths: IntArray

    @classmethod
    def over(cls, size: tuple[int, int], padding: int, *, most_cells: int) -> Grid:
        """Grid of a texture, at most so many cells wide and high.

        The lower left corner of its first cell is `padding` texels from both borders.
        """
        cell = -(-max(size) // most_cells)
        width, height = ((length - 2 * padding) // cell for length in size)
        steps = np.arange(2 * padding // cell + 2)
        # The nearest texel centers of two cells so many steps apart along one axis.
        texels = np.where(steps > 0, steps * cell - (cell - 1), 0)
        # Centers 2 padding apart are too near: the texel in their middle is within reach of both.
        near = texels[:, None] ** 2 + texels[None, :] ** 2 <= (2 * padding) ** 2
        counts = near.sum(axis=1)[near.any(axis=1)].astype(np.int32) - 1
        half_widths = np.concatenate([counts[:0:-1], counts])
        return cls(width=width, height=height, cell=cell, half_widths=half_widths)


@dataclass(frozen=True, kw_only=True, eq=False)
class Bitmaps:
    """Cells that charts touch, at one scale, in several poses: turned by different angles.

    Attributes
    ----------
    boxes : (C, K, 2) int64
        Columns and rows of the bitmap of each chart and pose.
    shifts : (C, K, 2) float64
        What moves the scaled coordinates into the bitmap's cells, centered.
    starts : (C, K) int64
        Where each bitmap begins in `masks`, row by row.
    masks : (sum of columns times rows,) uint8
        1 where a cell is touched.
    """

    boxes: LongArray
    shifts: FloatArray
    starts: LongArray
    masks: npt.NDArray[np.uint8]


def rasterize_charts(
    corners: FloatArray,
    face_charts: IntArray,
    low: FloatArray,
    extents: FloatArray,
    *,
    scale: float,
    margin: float,
) -> Bitmaps:
    """Find the cells that each chart touches in each of its poses.

    Parameters
    ----------
    corners : (F, 3, K, 2) float64
        Coordinates of the corners of faces, in K poses.
    face_charts : (F,) int32
    low, extents : (C, K, 2) float64
        Lower left corner and size of each chart's bounding box.
    scale : float
        Cells a unit.
    margin : float
        Cells that a face is taken to reach beyond its edges. From 0 on, a cell that the chart
        reaches is marked, be it by a point; from -0.5 on, one whose center lies within
        `margin + 0.5` of it along both axes.

    A chart that no cell would be marked for takes one.
    """
    boxes = np.maximum(np.ceil(extents * scale + 2.0 * margin), 1.0).astype(np.int64)
    shifts = (boxes - extents * scale) / 2.0 - low * scale
    n_cells = boxes.prod(axis=2)
    starts = np.cumsum(n_cells.ravel()).reshape(n_cells.shape) - n_cells
    masks = np.zeros(n_cells.sum(), dtype=np.uint8)
    mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks)
    empty = np.add.reduceat(masks, starts.ravel(), dtype=np.int64) == 0
    masks[starts.ravel()[empty]] = 1
    return Bitmaps(boxes=boxes, shifts=shifts, starts=starts, masks=masks)


class Shapes(NamedTuple):
    """Cells of charts in O orientations, as runs along rows.

    Attributes
    ----------
    boxes : (C, O, 2) int32
        Columns and rows of each chart in each orientation.
    spans : (S, 3) int32
        Row, begin and end of each run; those of one chart and orientation together, by rows.
    starts : (C, O, 2) int64
        Where the runs of each begin in `spans`, and where they end.
    reach : (R, 3) int32
    reach_starts : (C, O, 2) int64
        The same for the cells that no other chart may touch.
    margin : int
        Cells that these reach beyond the box of the chart.
    """

    boxes: IntArray
    spans: IntArray
    starts: npt.NDArray[np.int64]
    reach: IntArray
    reach_starts: npt.NDArray[np.int64]
    margin: int


def shapes_of(bitmaps: Bitmaps, half_widths: IntArray, *, turns: int) -> Shapes:
    """Find the runs of charts in so many quarter turns of each pose.

    Orientation `pose * turns + turn` is that turn of that pose; `half_widths` are a grid's.
    """
    n_charts, n_poses = bitmaps.starts.shape
    boxes = np.repeat(bitmaps.boxes, turns, axis=1).astype(np.int32)
    boxes[:, 1::2] = boxes[:, 1::2, ::-1] if turns > 1 else boxes[:, 1::2]
    # A row of n cells holds at most (n + 1) / 2 runs.
    most = int(((boxes[..., 0].astype(np.int64) + 1) // 2 * boxes[..., 1]).sum())
    spans = np.empty((most, 3), dtype=np.int32)
    starts = np.empty((n_charts, n_poses * turns, 2), dtype=np.int64)
    n_spans = spans_kernel(bitmaps.masks, bitmaps.starts, bitmaps.boxes, turns, spans, starts)
    spans = spans[:n_spans].copy()
    margin = len(half_widths) // 2
    if margin == 0:
        return Shapes(boxes, spans, starts, spans, starts, 0)
    # Dilation joins runs and makes none, but for new rows, each with no more than the one below.
    reach = np.empty((n_spans * (2 * margin + 1), 3), dtype=np.int32)
    reach_starts = np.empty_like(starts)
    n_reach = reach_kernel(spans, starts, boxes, half_widths, reach, reach_starts)
    return Shapes(boxes, spans, starts, reach[:n_reach].copy(), reach_starts, margin)
