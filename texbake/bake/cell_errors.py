"""How far the samples of cells may be from the means over them, judged by the samples beside them.

What is looked at is a cell's neighbors, or the larger cells that stand in their place: the second
difference s along an axis. Where the value bends by s at a line through the center, the mean is off
by s / 8, where it leaps by s, up to s / 2, and where it curves smoothly, by s / 24. At the border
of a chart the covered part of a cell has its middle elsewhere than the cell, by up to a quarter of
the first difference. It is an estimate: what lies between all samples is not seen.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", 1980, as `cells` is; the
shares are those of straight lines through cells, by integration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.bake.cells import COVERAGE_SIDE, NO_CHART, FloatArray32, Level, TexelState
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

# Share of a second difference that a sample may be off by: between a bend's 1/8 and a leap's 1/2.
_BEND = 0.25
_BORDER = 0.25  # share of a first difference, at a border
_NOWHERE = (-1, -1)  # place and level of no cell


@dataclass(frozen=True, eq=False)
class Metric:
    """How differences of values are measured: as multiples of what each map may be off by.

    Attributes
    ----------
    groups : (C,) int32
        Map of each channel.
    scales : (maps,) float64
        One by the bound of each map; 0 where it has none.
    """

    groups: IntArray
    scales: npt.NDArray[np.float64]


def estimate_errors(
    levels: list[Level], shape: tuple[int, int], metric: Metric, state: TexelState,
    threads: int | None,
) -> FloatArray32:  # fmt: skip
    """How far each sample of the last level may be from the mean over its cell, in bounds.

    Infinite for a texel without a value at its center, which may have some elsewhere.
    """
    level = levels[-1]
    errors = np.empty(len(level.ids), dtype=np.float32)
    # One array for all levels: a kernel that chooses among several is slower by far.
    firsts = np.cumsum([0, *(len(cells.ids) for cells in levels)])
    links = np.concatenate([cells.first_children for cells in levels])
    charts = np.concatenate([cells.charts for cells in levels])
    values = np.concatenate([cells.values for cells in levels])

    def estimate(start: int, stop: int) -> None:
        _errors_kernel(
            (len(levels) - 1, shape[0], shape[1], firsts),
            (links, charts, values),
            level.ids[start:stop],
            (metric.groups, metric.scales),
            state.covered,
            start,
            errors[start:stop],
        )

    run_bands(estimate, len(errors), band=1 << 16, threads=threads)
    return errors


@kernel
def _find(size, links, row, column):  # type: ignore[no-untyped-def]
    """Place and level of the cell that holds a cell's center: that cell, or one above it."""
    level, height, width, firsts = size
    if row < 0 or column < 0 or row >= height << level or column >= width << level:
        return _NOWHERE
    place = (row >> level) * width + (column >> level)
    for above in range(level):
        first = links[place]
        if first < 0:
            return place, above
        shift = level - 1 - above
        place = firsts[above + 1] + first + ((row >> shift) & 1) * 2 + ((column >> shift) & 1)
    return place, level


@kernel
def _difference(metric, values, a, b, center):  # type: ignore[no-untyped-def]
    """How much two cells differ from one, by how far away they are; the greatest over the maps.

    Each is a place and a level; b is nowhere where there is none.
    """
    groups, scales = metric
    # The middle of a cell above the neighbor lies farther away than that of the neighbor.
    near_a = 1.0 / (0.5 + 0.5 * (1 << (center[1] - a[1])))
    near_b = 0.0 if b[1] < 0 else 1.0 / (0.5 + 0.5 * (1 << (center[1] - b[1])))
    worst, square = 0.0, 0.0
    n_channels = len(groups)
    for channel in range(n_channels):
        v = float(values[center[0], channel])
        d = near_a * (values[a[0], channel] - v)
        if b[1] >= 0:
            d += near_b * (values[b[0], channel] - v)
        square += d * d
        if channel + 1 == n_channels or groups[channel + 1] != groups[channel]:
            worst = max(worst, np.sqrt(square) * scales[groups[channel]])
            square = 0.0
    return worst


@kernel
def _errors_kernel(size, cells, ids, metric, covered, first, errors):  # type: ignore[no-untyped-def]
    level, _, width, firsts = size
    links, charts, values = cells
    n_columns = width << level
    full = COVERAGE_SIDE * COVERAGE_SIDE
    for i in range(len(ids)):
        row, column = ids[i] // n_columns, ids[i] % n_columns
        cell = (firsts[level] + first + i, level)
        own = charts[cell[0]]
        error = 0.0
        n_valued = 0
        for axis in range(2):
            found = 0
            other = cell
            for sign in (-1, 1):
                dy, dx = sign * axis, sign * (1 - axis)
                near = _find(size, links, row + dy, column + dx)
                chart = NO_CHART if near[1] < 0 else charts[near[0]]
                if chart == NO_CHART or (own != NO_CHART and chart != own):
                    continue
                if own == NO_CHART:
                    # What of this cell is covered, if anything, is taken to be as its neighbors.
                    n_valued += 1
                    far = _find(size, links, row + 2 * dy, column + 2 * dx)
                    if far[1] >= 0 and near[1] == level and charts[far[0]] == chart:
                        step = _difference(metric, values, far, _NOWHERE, near)
                        error = max(error, _BORDER * step)
                    continue
                found += 1
                if found == 2:
                    error += _BEND * _difference(metric, values, near, other, cell)
                other = near
            if found == 1:
                error += _BORDER * _difference(metric, values, other, _NOWHERE, cell)
        if level == 0 and own == NO_CHART:
            some = covered[ids[i]] > 0 and (n_valued > 0 or covered[ids[i]] < full)
            error = np.inf if some else 0.0
        errors[i] = error
