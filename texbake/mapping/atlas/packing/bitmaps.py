"""Charts as bitmaps: the cells that each one touches, and how far apart charts are kept."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
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
    _mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks)
    empty = np.add.reduceat(masks, starts.ravel(), dtype=np.int64) == 0
    masks[starts.ravel()[empty]] = 1
    return Bitmaps(boxes=boxes, shifts=shifts, starts=starts, masks=masks)


@kernel
def _mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks):  # type: ignore[no-untyped-def]
    """Mark each cell that a face touches, or comes nearer to than `margin`, in its pose's mask."""
    n_poses = corners.shape[2]
    for item in range(len(corners) * n_poses):
        face, pose = item // n_poses, item % n_poses
        chart = face_charts[face]
        width, height = boxes[chart, pose, 0], boxes[chart, pose, 1]
        x = corners[face, :, pose, 0] * scale + shifts[chart, pose, 0]
        y = corners[face, :, pose, 1] * scale + shifts[chart, pose, 1]
        first = max(math.floor(y.min() - margin), 0)
        last = min(math.floor(y.max() + margin), height - 1)
        for row in range(first, last + 1):
            left, right = _extent_between(x, y, row - margin, row + 1 + margin)
            begin = max(math.floor(left - margin), 0)
            end = min(math.floor(right + margin), width - 1)
            start = starts[chart, pose] + row * width
            for column in range(begin, end + 1):
                masks[start + column] = 1


@kernel
def _extent_between(x, y, bottom, top):  # type: ignore[no-untyped-def]
    """Least and greatest x of what of a triangle lies between two heights, which it reaches."""
    left, right = np.inf, -np.inf
    for i in range(3):
        x0, y0, x1, y1 = x[i], y[i], x[(i + 1) % 3], y[(i + 1) % 3]
        if max(y0, y1) < bottom or min(y0, y1) > top:
            continue
        t0, t1 = 0.0, 1.0
        if y0 != y1:
            t_bottom, t_top = (bottom - y0) / (y1 - y0), (top - y0) / (y1 - y0)
            t0, t1 = max(0.0, min(t_bottom, t_top)), min(1.0, max(t_bottom, t_top))
        begin, end = x0 + t0 * (x1 - x0), x0 + t1 * (x1 - x0)
        left, right = min(left, begin, end), max(right, begin, end)
    return left, right
