"""Charts as runs of cells, in each orientation, with the cells that others must not touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mapping.atlas.packing.bitmaps import Bitmaps
from texbake.mapping.atlas.packing.place import spans_of
from texbake.mesh.mesh import IntArray


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
    n_spans = _spans_kernel(bitmaps.masks, bitmaps.starts, bitmaps.boxes, turns, spans, starts)
    spans = spans[:n_spans].copy()
    margin = len(half_widths) // 2
    if margin == 0:
        return Shapes(boxes, spans, starts, spans, starts, 0)
    # Dilation joins runs and makes none, but for new rows, each with no more than the one below.
    reach = np.empty((n_spans * (2 * margin + 1), 3), dtype=np.int32)
    reach_starts = np.empty_like(starts)
    n_reach = _reach_kernel(spans, starts, boxes, half_widths, reach, reach_starts)
    return Shapes(boxes, spans, starts, reach[:n_reach].copy(), reach_starts, margin)


@kernel
def _spans_kernel(masks, mask_starts, mask_boxes, turns, spans, starts):  # type: ignore[no-untyped-def]
    """Write the runs of all charts, poses and turns; return their number."""
    count = 0
    n_charts, n_poses = mask_starts.shape
    for chart in range(n_charts):
        for orientation in range(n_poses * turns):
            pose, turn = orientation // turns, orientation % turns
            width, height = mask_boxes[chart, pose, 0], mask_boxes[chart, pose, 1]
            start = mask_starts[chart, pose]
            mask = masks[start : start + width * height].reshape(height, width)
            starts[chart, orientation, 0] = count
            count += spans_of(mask, turn, spans[count:])
            starts[chart, orientation, 1] = count
    return count


@kernel
def _reach_kernel(spans, starts, boxes, half_widths, reach, reach_starts):  # type: ignore[no-untyped-def]
    """Write the runs of the cells near the charts; return their number."""
    margin = len(half_widths) // 2
    count = 0
    for chart in range(starts.shape[0]):
        for orientation in range(starts.shape[1]):
            width = boxes[chart, orientation, 0] + 2 * margin
            height = boxes[chart, orientation, 1] + 2 * margin
            mask = np.zeros((height, width), dtype=np.uint8)
            for i in range(starts[chart, orientation, 0], starts[chart, orientation, 1]):
                for step in range(2 * margin + 1):
                    aside = half_widths[step]
                    begin, end = spans[i, 1] + margin - aside, spans[i, 2] + margin + aside
                    for column in range(begin, end):
                        mask[spans[i, 0] + step, column] = 1
            reach_starts[chart, orientation, 0] = count
            n_spans = spans_of(mask, 0, reach[count:])
            for i in range(count, count + n_spans):
                for part in range(3):
                    reach[i, part] -= margin
            count += n_spans
            reach_starts[chart, orientation, 1] = count
    return count
