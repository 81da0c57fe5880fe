"""Kernels that measure how much of each pixel faces and lines cover, in bounded time.

A pixel has a fixed number of samples. Once a pixel is full it is skipped, so that a picture of a
hundred thousand faces on top of one another takes no longer than one of a few dozen, and looks the
same.

Based on: R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975 (finding the
next pixel of a row that is not yet full).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

SAMPLES = 4  # along each side of a pixel; their square must fit the bits of an outline mask

_MOST_LAYERS = 32  # faces over one pixel whose colors are mixed

# Most faces or lines drawn in one pixel and in one row: far more than any usable layout has.
_MOST_LOOKS = 512
_MOST_ROW_LOOKS = 1 << 18


@kernel
def _next(after, row, place):  # type: ignore[no-untyped-def]
    """First place from `place` on that is not done; shortens the path for the next search."""
    while after[row, place] != place:
        after[row, place] = after[row, after[row, place]]
        place = after[row, place]
    return place


@kernel
def _extent(x0, y0, x1, y1, low, high):  # type: ignore[no-untyped-def]
    """Least and greatest x of a line between two heights; (inf, -inf) if it has no part there."""
    if y0 > y1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    if y1 < low or y0 > high:
        return np.inf, -np.inf
    start = x0 if y0 >= low else x0 + (x1 - x0) * ((low - y0) / (y1 - y0))
    end = x1 if y1 <= high else x0 + (x1 - x0) * ((high - y0) / (y1 - y0))
    return min(start, end), max(start, end)


@kernel
def fill_kernel(  # type: ignore[no-untyped-def]
    pixels, colors, top, half_edge, edge_light, columns, rows, looks, sums
):
    """Add the colors of the samples that each face covers, and their number, to `sums`."""
    n_rows, n_columns = sums.shape[:2]
    step, n_samples = 1.0 / SAMPLES, SAMPLES * SAMPLES
    lines = np.empty((3, 3))  # one for each edge: the distance inwards is a x + b y + c
    x, y = np.empty(3), np.empty(3)
    for face in range(len(pixels)):
        for i in range(3):
            x[i], y[i] = pixels[face, i, 0], pixels[face, i, 1] - top
        first, last = max(min(y[0], y[1], y[2]), 0.0), max(y[0], y[1], y[2])
        area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
        if last < 0.0 or first >= n_rows or area == 0.0:
            continue
        for i in range(3):
            j = (i + 1) % 3
            length = math.copysign(math.hypot(x[j] - x[i], y[j] - y[i]), area)
            lines[i, 0], lines[i, 1] = (y[i] - y[j]) / length, (x[j] - x[i]) / length
            lines[i, 2] = -(lines[i, 0] * x[i] + lines[i, 1] * y[i])
        stop = int(min(last, n_rows - 1.0)) + 1
        row = _next(rows, 0, int(first))
        while row < stop:
            left, right = np.inf, -np.inf
            for i in range(3):
                j = (i + 1) % 3
                start, end = _extent(x[i], y[i], x[j], y[j], row, row + 1.0)
                left, right = min(left, start), max(right, end)
            until = int(min(right, n_columns - 1.0)) + 1 if right >= 0.0 else 0
            column = _next(columns, row, int(min(max(left, 0.0), n_columns)))
            while column < until:
                nearest, farthest = np.inf, np.inf  # distances of the pixel's corners to an edge
                for i in range(3):
                    middle = lines[i, 0] * (column + 0.5) + lines[i, 1] * (row + 0.5) + lines[i, 2]
                    span = 0.5 * (abs(lines[i, 0]) + abs(lines[i, 1]))
                    nearest, farthest = min(nearest, middle - span), min(farthest, middle + span)
                if nearest >= half_edge:
                    for channel in range(3):
                        sums[row, column, channel] += n_samples * colors[face, channel]
                    sums[row, column, 3] += n_samples
                elif farthest >= 0.0:
                    for sample in range(n_samples):
                        sx = column + (sample % SAMPLES + 0.5) * step
                        sy = row + (sample // SAMPLES + 0.5) * step
                        inwards = np.inf
                        for i in range(3):
                            way = lines[i, 0] * sx + lines[i, 1] * sy + lines[i, 2]
                            inwards = min(inwards, way)
                        if inwards < 0.0:
                            continue
                        light = edge_light if inwards < half_edge else 1.0
                        for channel in range(3):
                            sums[row, column, channel] += light * colors[face, channel]
                        sums[row, column, 3] += 1.0
                looks[row, column] += 1
                full = sums[row, column, 3] >= _MOST_LAYERS * n_samples
                if full or looks[row, column] == _MOST_LOOKS:
                    columns[row, column] = column + 1
                column = _next(columns, row, column + 1)
            looks[row, n_columns] += 1
            if looks[row, n_columns] == _MOST_ROW_LOOKS or _next(columns, row, 0) == n_columns:
                rows[0, row] = row + 1
            row = _next(rows, 0, row + 1)


@kernel
def outline_kernel(ends, top, radius, columns, rows, looks, masks):  # type: ignore[no-untyped-def]
    """Set the bit of each sample that lies on a line."""
    n_rows, n_columns = masks.shape
    n_samples = SAMPLES * SAMPLES
    whole = np.uint16((1 << n_samples) - 1)
    for line in range(len(ends)):
        x0, y0 = ends[line, 0, 0], ends[line, 0, 1] - top
        x1, y1 = ends[line, 1, 0], ends[line, 1, 1] - top
        dx, dy = x1 - x0, y1 - y0
        square = max(dx * dx + dy * dy, 1e-300)  # a point is a line as well
        first, last = max(min(y0, y1) - radius, 0.0), max(y0, y1) + radius
        if last < 0.0 or first >= n_rows:
            continue
        stop = int(min(last, n_rows - 1.0)) + 1
        row = _next(rows, 0, int(first))
        while row < stop:
            left, right = _extent(x0, y0, x1, y1, row - radius, row + 1.0 + radius)
            left, right = left - radius, right + radius
            until = int(min(right, n_columns - 1.0)) + 1 if right >= 0.0 else 0
            column = _next(columns, row, int(min(max(left, 0.0), n_columns)))
            while column < until:
                for sample in range(n_samples):
                    sx = column + (sample % SAMPLES + 0.5) / SAMPLES - x0
                    sy = row + (sample // SAMPLES + 0.5) / SAMPLES - y0
                    t = min(max((sx * dx + sy * dy) / square, 0.0), 1.0)
                    if math.hypot(sx - t * dx, sy - t * dy) <= radius:
                        masks[row, column] |= np.uint16(1 << sample)
                looks[row, column] += 1
                if masks[row, column] == whole or looks[row, column] == _MOST_LOOKS:
                    columns[row, column] = column + 1
                column = _next(columns, row, column + 1)
            looks[row, n_columns] += 1
            if looks[row, n_columns] == _MOST_ROW_LOOKS or _next(columns, row, 0) == n_columns:
                rows[0, row] = row + 1
            row = _next(rows, 0, row + 1)
