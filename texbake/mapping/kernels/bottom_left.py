"""Kernels that place charts one after another, each in the lowest and then leftmost free place.

Free cells are stored as runs, so that a search along a row jumps from obstacle to obstacle instead
of going from cell to cell. The whole bitmap is searched, not only its skyline, so that holes fill.

Based on: Bruno Lévy, Sylvain Petitjean, Nicolas Ray, Jérome Maillot, "Least squares conformal maps
for automatic texture atlas generation", 2002 (charts packed by their shape, large ones first).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.kernels.chart_bitmaps import spans_of


@kernel
def place_kernel(  # type: ignore[no-untyped-def]
    masks, starts, boxes, order, half_widths, all_or_nothing, hurry, runs, places, tops
):
    """Place the charts of `order`, each where its top ends lowest; return (missing, work).

    `runs` holds, for each cell, how many cells are free from it to the right; or, as a negative
    number, how many at least are blocked.
    """
    n_rows, n_columns = runs.shape
    for row in range(n_rows):
        for column in range(n_columns):
            runs[row, column] = n_columns - column
    # Where to start searching for a box of about a given size: the last one found nothing before.
    firsts = np.zeros((64, 64, 2), dtype=np.int32)
    spans = np.empty((1, 3), dtype=np.int32)
    best_spans = np.empty((1, 3), dtype=np.int32)
    n_missing, work = 0, n_rows * n_columns // 4
    turns = 4 if hurry < 2 else 2
    for chart in order:
        least_top, n_best_spans = n_rows + 1, 0
        for item in range(turns * boxes.shape[1]):
            pose, turn = item // turns, item % turns
            across, up = boxes[chart, pose, 0], boxes[chart, pose, 1]
            width, height = (across, up) if turn % 2 == 0 else (up, across)
            if width > n_columns or height >= least_top:
                continue
            start = starts[chart, pose]
            mask = masks[start : start + across * up].reshape(up, across)
            if len(spans) < across * up:
                spans = np.empty((across * up, 3), dtype=np.int32)
            n_spans = spans_of(mask, turn, spans)
            first = firsts[_size_class(width, hurry), _size_class(height, hurry)]
            x, y, steps = _lowest_place(
                spans[:n_spans], width, height, runs, first[0], first[1], least_top
            )
            work += steps + across * up
            if hurry > 0:
                if y >= 0:
                    first[0], first[1] = x, y
                elif least_top - height > first[1]:
                    first[0], first[1] = 0, least_top - height
            if y >= 0:
                least_top, n_best_spans = y + height, n_spans
                places[chart, 0], places[chart, 1] = x, y
                places[chart, 2], places[chart, 3] = pose, turn
                spans, best_spans = best_spans, spans
        if n_best_spans == 0:
            n_missing += 1
            if all_or_nothing:
                break
            continue
        tops[chart] = least_top
        x, y = places[chart, 0], places[chart, 1]
        work += _block(best_spans[:n_best_spans], x, y, half_widths, runs)
    return n_missing, work


@kernel
def _size_class(length, hurry):  # type: ignore[no-untyped-def]
    """Size class of a length: eighths of octaves, or whole octaves if `hurry` is 2."""
    parts = 8 if hurry < 2 else 1
    octave, rest = 0, length
    while rest >= 2 * parts:
        rest //= 2
        octave += 1
    return min(parts * octave + rest, 63)


@kernel
def _lowest_place(spans, width, height, runs, first_x, first_y, below):  # type: ignore[no-untyped-def]
    """Lowest, then leftmost free place from (first_x, first_y) on; return x, y and the steps."""
    n_rows, n_columns = runs.shape
    n_spans = len(spans)
    probe = 0  # the span that failed last is the likeliest to fail again
    steps = 0
    for y in range(first_y, min(n_rows, below - 1) - height + 1):
        x = first_x if y == first_y else 0
        passed = 0
        while passed < n_spans and x + width <= n_columns:
            steps += 1
            row, begin, end = spans[probe, 0], spans[probe, 1], spans[probe, 2]
            run = runs[y + row, x + begin]
            if run >= end - begin:
                passed += 1
                probe = probe + 1 if probe + 1 < n_spans else 0
                continue
            # Jump over the obstacle to the next free cell of that row.
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
        if passed == n_spans and x + width <= n_columns:
            return x, y, steps
    return -1, -1, steps


@kernel
def _block(spans, x, y, half_widths, runs):  # type: ignore[no-untyped-def]
    """Block the cells near a chart that was just placed; return the number of steps."""
    n_rows, n_columns = runs.shape
    reach = len(half_widths) // 2
    steps = 0
    for i in range(len(spans)):
        for step in range(-reach, reach + 1):
            row = y + spans[i, 0] + step
            if row < 0 or row >= n_rows:
                continue
            aside = half_widths[step + reach]
            begin = max(x + spans[i, 1] - aside, 0)
            end = min(x + spans[i, 2] + aside, n_columns)
            steps += 1
            if runs[row, begin] <= begin - end:
                continue  # all of it is blocked already
            # Continue to the end of any blocked run that follows.
            after = end - runs[row, end] if end < n_columns and runs[row, end] < 0 else end
            for column in range(begin, end):
                runs[row, column] = column - after
            steps += end - begin
            column = begin - 1
            while column >= 0 and runs[row, column] > 0:
                runs[row, column] = begin - column
                column -= 1
    return steps
