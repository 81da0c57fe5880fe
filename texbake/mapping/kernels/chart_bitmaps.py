"""Kernels that rasterize charts into bitmaps, and bitmaps into runs of cells along rows."""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel


@kernel
def mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks):  # type: ignore[no-untyped-def]
    """Mark each cell within `margin` of a face, in the bitmap of its chart and pose."""
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
    """Least and greatest x of the part of a triangle that lies between two heights."""
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
def spans_of(mask, turn, spans):  # type: ignore[no-untyped-def]
    """Write the runs of marked cells of a rotated mask as (row, begin, end); return how many."""
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
def spans_kernel(masks, mask_starts, mask_boxes, turns, spans, starts):  # type: ignore[no-untyped-def]
    """Write the runs of all charts, poses and quarter turns; return how many."""
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
def reach_kernel(spans, starts, boxes, half_widths, reach, reach_starts):  # type: ignore[no-untyped-def]
    """Write the runs of cells that other charts may not touch; return how many."""
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


@kernel
def least_box_kernel(uvs, starts, cos, sin, best):  # type: ignore[no-untyped-def]
    """Write the index of the angle at which each chart has the smallest bounding box."""
    for chart in range(len(best)):
        least = np.inf
        for i in range(len(cos)):
            left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
            for j in range(starts[chart], starts[chart + 1]):
                x = uvs[j, 0] * cos[i] - uvs[j, 1] * sin[i]
                y = uvs[j, 0] * sin[i] + uvs[j, 1] * cos[i]
                left, right = min(left, x), max(right, x)
                bottom, top = min(bottom, y), max(top, y)
            area = (right - left) * (top - bottom)
            if area < least * (1.0 - 1e-9):  # more than rounding
                least = area
                best[chart] = i
