"""Kernels that move overlapping charts apart by guided local search.

One chart after another moves to where it overlaps the others least, among sampled places and
orientations that are followed downhill. The cost of an overlap is learnt for each pair of charts:
it grows while the pair overlaps and fades when it does not, which drives the search out of dead
ends.

Based on:

- Jens Egeblad, Benny K. Nielsen, Allan Odgaard, "Fast neighborhood search for two- and
  three-dimensional nesting problems", European Journal of Operational Research 183, 2007 (least
  overlap by guided local search).
- Jeroen Gardeyn, Greet Vanden Berghe, Tony Wauters, "An open-source heuristic to reboot 2D nesting
  research", 2025 (samples followed downhill; weights that grow with the overlap).

It departs from them in counting overlaps in cells of bitmaps. The cost of each cell is summed along
rows, so that one subtraction gives the cost of a run of cells, and a layout without overlap is
exact.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

_MOST_WEIGHT = 1 << 14
_ALL_OVER = 6  # one in this many moves samples the whole grid

NONE_YET = 1 << 60


@kernel
def separate_kernel(  # type: ignore[no-untyped-def]
    shapes,
    places,
    base,
    weights,
    overlaps,
    sums,
    n_samples,
    radius,
    step,
    patience,
    most_work,
    seed,
    best_places,
):
    """Move charts until none overlap; return the least overlap and the work."""
    n_charts = len(places)
    n_rows, n_columns = sums.shape[0], sums.shape[1] - 1
    order = np.arange(n_charts)
    moved = np.ones(n_charts, dtype=np.uint8)
    state = seed
    least, idle, work = NONE_YET, 0, 0
    while True:
        work += _renew_overlaps(shapes, places, moved, sums, overlaps)
        total = _learn(overlaps, base, weights, moved)
        if total < least:
            idle = 0 if total < least - least // 50 else idle
            least = total
            for a in range(n_charts):
                for part in range(3):
                    best_places[a, part] = places[a, part]
        if total == 0 or idle >= patience or work > most_work:
            return least, work
        idle += 1
        for i in range(n_charts - 1, 0, -1):
            state = next_random(state)
            k = (state >> 8) % (i + 1)
            order[i], order[k] = order[k], order[i]
        for chart in order:
            if not moved[chart]:
                continue
            state = next_random(state)
            aside = radius if (state >> 8) % _ALL_OVER else max(n_columns, n_rows)
            x, y, orientation = places[chart, 0], places[chart, 1], places[chart, 2]
            left, bottom = max(x - aside, 0), max(y - aside, 0)
            right = min(x + shapes.boxes[chart, orientation, 0] + aside, n_columns)
            top = min(y + shapes.boxes[chart, orientation, 1] + aside, n_rows)
            window = (left, bottom, right, top)
            work += sum_costs(chart, shapes, places, weights[chart], window, sums)
            state, steps = move(chart, shapes, places, sums, window, n_samples, step, state)
            work += steps
            if x == places[chart, 0] and y == places[chart, 1] and orientation == places[chart, 2]:
                moved[chart] = 0


@kernel
def _learn(overlaps, base, weights, overlapping):  # type: ignore[no-untyped-def]
    """Raise the weights of overlapping pairs and lower the others; return the total overlap."""
    n_charts = len(base)
    total, most = 0, 1
    for a in range(n_charts):
        overlapping[a] = 0
        for b in range(a):
            total += overlaps[a, b]
            most = max(most, overlaps[a, b] * base[a, b])
    for a in range(n_charts):
        for b in range(a):
            cost = overlaps[a, b] * base[a, b]
            weight = weights[a, b]
            if cost > 0:
                overlapping[a] = overlapping[b] = 1
                weight = min(weight * (5 * most + 4 * cost) // (4 * most) + 1, _MOST_WEIGHT)
            else:
                weight = max(weight * 15 // 16, base[a, b])
            weights[a, b] = weights[b, a] = weight
    return total


@kernel
def _renew_overlaps(shapes, places, moved, sums, overlaps):  # type: ignore[no-untyped-def]
    """Recount the overlaps of every chart that has moved; return the work."""
    n_charts = len(places)
    work = n_charts * n_charts
    for chart in range(n_charts):
        if not moved[chart]:
            continue
        x, y, orientation = places[chart, 0], places[chart, 1], places[chart, 2]
        right, top = (
            x + shapes.boxes[chart, orientation, 0],
            y + shapes.boxes[chart, orientation, 1],
        )
        # The number of this chart's cells, summed along each row.
        clear(sums, x, y, right, top)
        for i in range(shapes.starts[chart, orientation, 0], shapes.starts[chart, orientation, 1]):
            sums[y + shapes.spans[i, 0], x + shapes.spans[i, 1]] += 1
            sums[y + shapes.spans[i, 0], x + shapes.spans[i, 2]] -= 1
        integrate(sums, x, y, right, top)
        work += (right - x) * (top - y)
        for other in range(n_charts):
            if other == chart or (moved[other] and other < chart):
                continue
            count = 0
            if is_near(shapes, places, other, x, y, right, top):
                ox, oy, turned = places[other, 0], places[other, 1], places[other, 2]
                for i in range(
                    shapes.reach_starts[other, turned, 0], shapes.reach_starts[other, turned, 1]
                ):
                    row = oy + shapes.reach[i, 0]
                    begin = max(ox + shapes.reach[i, 1], x)
                    end = min(ox + shapes.reach[i, 2], right)
                    if y <= row < top and begin < end:
                        count += sums[row, end] - sums[row, begin]
            overlaps[chart, other] = overlaps[other, chart] = count
    return work


@kernel
def next_random(state):  # type: ignore[no-untyped-def]
    """Next state of a linear congruential generator, of which the bits from 8 up are used."""
    return (state * 1103515245 + 12345) & 0x7FFFFFFF


@kernel
def is_near(shapes, places, chart, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Whether a rectangle may come within the margin of a chart."""
    x, y, orientation = places[chart, 0], places[chart, 1], places[chart, 2]
    return (
        x - shapes.margin < right
        and y - shapes.margin < top
        and x + shapes.boxes[chart, orientation, 0] + shapes.margin > left
        and y + shapes.boxes[chart, orientation, 1] + shapes.margin > bottom
    )


@kernel
def clear(sums, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Set a rectangle of `sums` to 0."""
    for row in range(bottom, top):
        for column in range(left, right + 1):
            sums[row, column] = 0


@kernel
def integrate(sums, left, bottom, right, top):  # type: ignore[no-untyped-def]
    """Turn the steps of a value along each row into sums of the value over the cells before."""
    for row in range(bottom, top):
        value, total = 0, 0
        for column in range(left, right + 1):
            value += sums[row, column]
            sums[row, column] = total
            total += value


@kernel
def sum_costs(chart, shapes, places, weights, window, sums):  # type: ignore[no-untyped-def]
    """Sum along rows what each cell of a window costs a chart; return the work."""
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
    """Weighted overlap of a chart at a place; not exact once it has reached `limit`."""
    total = 0
    # Rows far apart come first, so that a large overlap shows early.
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
    """Move a chart to the cheapest place in a window that samples lead to; return state and work.

    Samples are spread over the window; a third of them lie near the chart's present place.
    """
    left, bottom, right, top = window
    x0, y0, o0 = places[chart, 0], places[chart, 1], places[chart, 2]
    # Costs of the present place and the best three samples; their column, row and orientation.
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
    """Follow lower costs downhill, changing `place`; return the final cost and the steps."""
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
