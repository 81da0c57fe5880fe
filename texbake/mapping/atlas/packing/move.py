"""One chart moved to where it overlaps the others least: samples of places, followed downhill.

What each cell costs a chart is summed up along rows, so that one subtraction tells what a run of
cells costs at a place.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

NONE_YET = 1 << 60


@kernel
def next_random(state):  # type: ignore[no-untyped-def]
    """The next state of a linear congruential generator; its bits from 8 on are random enough."""
    return (state * 1103515245 + 12345) & 0x7FFFFFFF


@kernel
def is_near(shapes, places, chart, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Whether the reach of a chart may meet a rectangle."""
    x, y, orientation = places[chart, 0], places[chart, 1], places[chart, 2]
    return (
        x - shapes.margin < right
        and y - shapes.margin < top
        and x + shapes.boxes[chart, orientation, 0] + shapes.margin > left
        and y + shapes.boxes[chart, orientation, 1] + shapes.margin > bottom
    )


@kernel
def clear(sums, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Make a rectangle of sums ready for new steps."""
    for row in range(bottom, top):
        for column in range(left, right + 1):
            sums[row, column] = 0


@kernel
def integrate(sums, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Turn steps of a value along rows into sums of the value over all cells before each."""
    for row in range(bottom, top):
        value, total = 0, 0
        for column in range(left, right + 1):
            value += sums[row, column]
            sums[row, column] = total
            total += value


@kernel
def sum_costs(chart, shapes, places, weights, window, sums):  # type: ignore[no-untyped-def]
    """Sum up along rows what each cell of a window costs a chart; return the work."""
    left, bottom, right, top = window
    clear(sums, left, bottom, right, top)
    for other in range(len(places)):
        if other == chart or not is_near(shapes, places, other, left, bottom, right, top):
            continue
        x, y, orientation = places[other, 0], places[other, 1], places[other, 2]
        for i in range(
            shapes.reach_starts[other, orientation, 0], shapes.reach_starts[other, orientation, 1]
        ):
            row = y + shapes.reach[i, 0]
            begin, end = max(x + shapes.reach[i, 1], left), min(x + shapes.reach[i, 2], right)
            if bottom <= row < top and begin < end:
                sums[row, begin] += weights[other]
                sums[row, end] -= weights[other]
    integrate(sums, left, bottom, right, top)
    return 2 * (right - left) * (top - bottom)


@kernel
def _cost(spans, sums, x, y, limit):  # type: ignore[no-untyped-def]
    """Weighted overlap of runs put at a place; some value from `limit` on where it is no less."""
    total = 0
    # Rows far apart first: a place that overlaps much is soon known to.
    stride = 7 if len(spans) > 14 else 1
    for phase in range(stride):
        for i in range(phase, len(spans), stride):
            row = y + spans[i, 0]
            total += sums[row, x + spans[i, 2]] - sums[row, x + spans[i, 1]]
        if total >= limit:
            return total
    return total


@kernel
def move(chart, shapes, places, sums, window, n_samples, step, state):  # type: ignore[no-untyped-def]
    """Put a chart where it costs least in a window, of what samples lead to; return the work too.

    Samples are spread over the window, a third of them about the chart's own place.
    """
    left, bottom, right, top = window
    x0, y0, o0 = places[chart, 0], places[chart, 1], places[chart, 2]
    # Of its own place, and of the best three samples: costs; column, row and orientation.
    costs, tops = np.empty(4, dtype=np.int64), np.zeros((4, 3), dtype=np.int64)
    for k in range(4):
        costs[k] = NONE_YET
    work = 0
    for k in range(-1, n_samples):
        state = next_random(state)
        orientation = (state >> 8) % shapes.boxes.shape[1] if k >= 0 else o0
        width, height = shapes.boxes[chart, orientation, 0], shapes.boxes[chart, orientation, 1]
        if width > right - left or height > top - bottom:
            continue
        state = next_random(state)
        across = state >> 8
        state = next_random(state)
        up = state >> 8
        if k < 0:
            x, y = x0, y0
        elif k % 3 == 0:
            x = min(max(x0 + across % (2 * step + 1) - step, left), right - width)
            y = min(max(y0 + up % (2 * step + 1) - step, bottom), top - height)
        else:
            x = left + across % (right - left - width + 1)
            y = bottom + up % (top - bottom - height + 1)
        first, last = shapes.starts[chart, orientation, 0], shapes.starts[chart, orientation, 1]
        cost = _cost(shapes.spans[first:last], sums, x, y, costs[3])
        work += last - first
        at = 0 if k < 0 else 3
        if cost >= costs[at]:
            continue
        while at > 1 and cost < costs[at - 1]:
            costs[at] = costs[at - 1]
            for part in range(3):
                tops[at, part] = tops[at - 1, part]
            at -= 1
        costs[at] = cost
        tops[at, 0], tops[at, 1], tops[at, 2] = x, y, orientation
        if cost == 0:
            break
    best = 0
    for k in range(4):
        if costs[k] < NONE_YET and costs[best] > 0:
            first = shapes.starts[chart, tops[k, 2], 0]
            last = shapes.starts[chart, tops[k, 2], 1]
            box = shapes.boxes[chart, tops[k, 2]]
            costs[k], steps = _descend(
                shapes.spans[first:last], box, sums, window, step, costs[k], tops[k]
            )
            work += steps * (last - first)
            best = k if costs[k] < costs[best] else best
    for part in range(3):
        places[chart, part] = tops[best, part]
    return state, work


@kernel
def _descend(spans, box, sums, window, step, cost, place):  # type: ignore[no-untyped-def]
    """Follow lower costs from a place, which is changed; return the cost there and the steps."""
    left, bottom, right, top = window
    n_steps = 0
    while cost > 0:
        found = False
        for neighbor in range(9):
            x = place[0] + (neighbor % 3 - 1) * step
            y = place[1] + (neighbor // 3 - 1) * step
            if neighbor == 4 or x < left or y < bottom or x + box[0] > right or y + box[1] > top:
                continue
            n_steps += 1
            there = _cost(spans, sums, x, y, cost)
            if there < cost:
                cost, found = there, True
                place[0], place[1] = x, y
                break
        if not found:
            if step == 1:
                break
            step //= 2
    return cost, n_steps
