"""Charts that lie on one another, moved apart: guided local search.

Of a layout in which charts overlap, one chart after another goes to where it overlaps the others
least, among samples of places and orientations that are followed downhill. How much an overlap
counts is learnt for each pair: it grows as long as the pair overlaps and fades when it does not,
which drives the search out of dead ends.

Based on:

- Jens Egeblad, Benny K. Nielsen, Allan Odgaard, "Fast neighborhood search for two- and
  three-dimensional nesting problems", European Journal of Operational Research 183, 2007 (least
  overlap by guided local search).
- Jeroen Gardeyn, Greet Vanden Berghe, Tony Wauters, "An open-source heuristic to reboot 2D nesting
  research", 2025 (samples followed downhill; weights that grow with the overlap).

It departs in counting overlaps in cells of bitmaps: sums along rows of what each cell costs tell
the overlap of a run of cells in one subtraction, and a layout without overlap is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.atlas.packing.move import (
    NONE_YET,
    clear,
    integrate,
    is_near,
    move,
    next_random,
    sum_costs,
)
from texbake.mapping.atlas.packing.shapes import Shapes
from texbake.mesh.mesh import FloatArray, IntArray

_BASE_WEIGHT = 2048.0  # of a cell that overlaps; fractions of it are counted, in integers
_MOST_WEIGHT = 1 << 14
_ALL_OVER = 6  # every so many moves a chart looks all over the grid


@dataclass(frozen=True, kw_only=True)
class Search:
    """How long and how far charts look for places.

    Attributes
    ----------
    samples : int
        Places that a move looks at before it follows the best ones downhill.
    radius : int
        Cells by which most moves go at most.
    step : int
        Cells of the first steps downhill.
    patience : int
        Sweeps over the charts without progress before it is given up.
    work : int
        Steps after which it is given up: a measure of time that is the same on every machine.
    """

    samples: int
    radius: int
    step: int
    patience: int
    work: int


def pair_weights(areas: FloatArray) -> IntArray:
    """(C, C) int32: what a cell of overlap costs each two charts, by their areas in cells.

    More where a chart is small, which has few cells to lose but as far to go.
    """
    sides = np.sqrt(np.minimum.outer(areas, areas) + 1.0)
    return np.asarray(np.clip(_BASE_WEIGHT / sides, 8.0, 2048.0), dtype=np.int32)


def separate(
    shapes: Shapes,
    places: IntArray,
    weights: IntArray,
    *,
    size: tuple[int, int],
    search: Search,
    seed: int,
) -> tuple[IntArray, int, int]:
    """Move charts until none touches what is out of bounds for it.

    Parameters
    ----------
    shapes : Shapes
    places : (C, 3) int32
        Column, row and orientation of each chart, inside the grid.
    weights : (C, C) int32
        As from `pair_weights`.
    size : (int, int)
        Columns and rows of the grid.
    search : Search
    seed : int
        Of the random samples.

    Returns
    -------
    places : (C, 3) int32
        Those of least overlap that were found.
    overlap : int
        Cells in which charts overlap there; 0 if they are apart.
    work : int
        Steps taken.
    """
    n_charts = len(places)
    best_places = places.copy()
    overlap, work = _separate_kernel(
        shapes,
        places.copy(),
        weights,
        weights.copy(),
        np.zeros((n_charts, n_charts), dtype=np.int32),
        np.zeros((size[1], size[0] + 1), dtype=np.int32),
        search.samples,
        search.radius,
        search.step,
        search.patience,
        search.work,
        seed,
        best_places,
    )
    return best_places, overlap, work


@kernel
def _separate_kernel(  # type: ignore[no-untyped-def]
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
    """Move charts until none overlap; return the least overlap found and the work done."""
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
    """Raise the weights of pairs that overlap, let the others fade; return the sum of overlaps."""
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
    """Count the cells in which each two charts overlap, where one has moved; return the work."""
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
        # Sums along rows of 1 for each cell of this chart.
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
