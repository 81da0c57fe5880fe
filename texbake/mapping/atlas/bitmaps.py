"""Charts as bitmaps: the cells that each one touches, and where they fit beside one another.

Free cells are kept as runs, so that a search along a row steps from one obstacle over the next
instead of from cell to cell.
"""

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
        Cells that a face is taken to reach beyond its edges.
    """
    boxes = np.ceil(extents * scale + 2.0 * margin).astype(np.int64)
    shifts = (boxes - extents * scale) / 2.0 - low * scale
    n_cells = boxes.prod(axis=2)
    starts = np.cumsum(n_cells.ravel()).reshape(n_cells.shape) - n_cells
    masks = np.zeros(n_cells.sum(), dtype=np.uint8)
    _mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks)
    return Bitmaps(boxes=boxes, shifts=shifts, starts=starts, masks=masks)


def place_charts(
    bitmaps: Bitmaps, order: IntArray, grid: Grid, *, hurried: bool = False
) -> LongArray | None:
    """Put charts, one after another, where they end lowest: in any pose and quarter turn.

    Parameters
    ----------
    bitmaps : Bitmaps
    order : (C,) int32
        Charts in the order in which they choose their places.
    grid : Grid
    hurried : bool
        Do not look again, for a chart with a bounding box of the same size, below the place of the
        one before: many times faster for thousands of charts, which fill a hundredth less.

    Returns
    -------
    (C, 4) int64 or None
        Column and row of the lower left cell, pose, and quarter turns counter-clockwise of each
        chart; None where they do not all fit.
    """
    places = np.empty((len(order), 4), dtype=np.int64)
    runs = np.empty((grid.height, grid.width), dtype=np.int32)
    fits = _place_kernel(
        bitmaps.masks,
        bitmaps.starts,
        bitmaps.boxes,
        order,
        grid.half_widths,
        hurried,
        runs,
        places,
    )
    return places if fits else None


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
            masks[start + begin : start + end + 1] = 1


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


@kernel
def _place_kernel(masks, starts, boxes, order, half_widths, hurried, runs, places):  # type: ignore[no-untyped-def]
    """Put the charts one after another where they end lowest; return whether all found a place.

    `places` gets (x, y, pose, quarter turns) of each chart. `runs` holds for each cell how many
    cells from it rightwards are free, or, negative, are not.
    """
    n_rows, n_columns = runs.shape
    n_poses = boxes.shape[1]
    blocked = np.zeros((n_rows, n_columns), dtype=np.uint8)
    for row in range(n_rows):
        for column in range(n_columns):
            runs[row, column] = n_columns - column
    # Where the search for a box of that size begins: below, the last one found no place.
    first_rows = np.zeros((n_columns + 1, n_rows + 1), dtype=np.int32)
    spans = np.empty((1, 3), dtype=np.int32)
    best_spans = np.empty((1, 3), dtype=np.int32)
    for chart in order:
        least_top, n_best_spans = n_rows + 1, 0
        for item in range(4 * n_poses):
            pose, turn = item // 4, item % 4
            across, up = boxes[chart, pose, 0], boxes[chart, pose, 1]
            width, height = (across, up) if turn % 2 == 0 else (up, across)
            if width > n_columns or height >= least_top:
                continue
            start = starts[chart, pose]
            mask = masks[start : start + across * up].reshape(up, across)
            if len(spans) < across * up:
                spans = np.empty((across * up, 3), dtype=np.int32)
            n_spans = _spans_of(mask, turn, spans)
            first = first_rows[width, height]
            x, y = _lowest_place(spans[:n_spans], width, height, runs, first, least_top)
            if hurried:
                first_rows[width, height] = max(first, y if y >= 0 else least_top - height)
            if y >= 0:
                least_top, n_best_spans = y + height, n_spans
                places[chart, 0], places[chart, 1] = x, y
                places[chart, 2], places[chart, 3] = pose, turn
                spans, best_spans = best_spans, spans
        if n_best_spans == 0:
            return False
        x, y = places[chart, 0], places[chart, 1]
        _block(best_spans[:n_best_spans], x, y, half_widths, blocked, runs)
    return True


@kernel
def _spans_of(mask, turn, spans):  # type: ignore[no-untyped-def]
    """Write the runs of marked cells of a turned mask as (row, begin, end); return their number."""
    height, width = mask.shape
    n_rows, n_columns = (height, width) if turn % 2 == 0 else (width, height)
    count = 0
    for row in range(n_rows):
        begin = -1
        for column in range(n_columns + 1):
            marked = False
            if column < n_columns:
                if turn == 0:
                    marked = mask[row, column] != 0
                elif turn == 1:
                    marked = mask[height - 1 - column, row] != 0
                elif turn == 2:
                    marked = mask[height - 1 - row, width - 1 - column] != 0
                else:
                    marked = mask[column, width - 1 - row] != 0
            if marked and begin < 0:
                begin = column
            elif not marked and begin >= 0:
                spans[count, 0], spans[count, 1], spans[count, 2] = row, begin, column
                count += 1
                begin = -1
    return count


@kernel
def _lowest_place(spans, width, height, runs, first, below):  # type: ignore[no-untyped-def]
    """Lowest, then leftmost free place for all spans, from row `first` on, with a top `below`."""
    n_rows, n_columns = runs.shape
    n_spans = len(spans)
    probe = 0  # the span that failed last is the likeliest to fail again
    for y in range(first, min(n_rows, below - 1) - height + 1):
        x, passed = 0, 0
        while passed < n_spans and x + width <= n_columns:
            row, begin, end = spans[probe, 0], spans[probe, 1], spans[probe, 2]
            run = runs[y + row, x + begin]
            if run >= end - begin:
                passed += 1
                probe = probe + 1 if probe + 1 < n_spans else 0
                continue
            # To the next free cell of that row, past whatever stands in the way.
            passed = 0
            if run > 0:
                x += run
                if x + begin >= n_columns:
                    x = n_columns
                    break
                run = runs[y + row, x + begin]
            x -= run
            if x + begin >= n_columns:
                break
        if passed == n_spans:
            return x, y
    return -1, -1


@kernel
def _block(spans, x, y, half_widths, blocked, runs):  # type: ignore[no-untyped-def]
    """Block the cells near a chart that has been placed, and renew the runs of their rows."""
    n_rows, n_columns = runs.shape
    reach = len(half_widths) // 2
    for i in range(len(spans)):
        for step in range(-reach, reach + 1):
            row = y + spans[i, 0] + step
            if 0 <= row < n_rows:
                aside = half_widths[step + reach]
                begin = max(x + spans[i, 1] - aside, 0)
                end = min(x + spans[i, 2] + aside, n_columns)
                blocked[row, begin:end] = 1
    first = max(y + spans[0, 0] - reach, 0)
    last = min(y + spans[len(spans) - 1, 0] + reach, n_rows - 1)
    for row in range(first, last + 1):
        run = 0
        for column in range(n_columns - 1, -1, -1):
            if blocked[row, column]:
                run = run - 1 if run < 0 else -1
            else:
                run = run + 1 if run > 0 else 1
            runs[row, column] = run
