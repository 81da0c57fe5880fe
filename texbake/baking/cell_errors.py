"""How far the samples of cells may be from the means over them, judged by the cells beside them.

What is looked at is the second difference s along an axis, half of which a leap may be off by, and
an eighth, a bend. At the border of a chart the covered part of a cell has its middle elsewhere than
its sample. It is an estimate: what lies between all samples is not seen.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", 1980, as `cells` is.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.cells import (
    LAST_LEVEL,
    NO_CHART,
    NO_CHILD,
    BoolArray,
    Cells,
    FloatArray32,
    Level,
)
from texbake.baking.coverage import FINE, Coverage
from texbake.baking.neighbors import Metric
from texbake.kernels import kernel
from texbake.parallel import run_bands

# Share of a second difference that a sample may be off by: a bend's 1/8, and a little for leaps,
# whose 1/2 in the cells along them has either sign.
_BEND = 0.15
_BORDER = 0.25  # share of a first difference, at a border
_NOWHERE = -1


def judge_cells(
    cells: Cells, k: int, shape: tuple[int, int], metric: Metric, threads: int | None
) -> FloatArray32:
    """Estimated errors of the cells of the k-th level, in bounds; finer ones are not looked at."""
    level = cells.levels[k - 1]
    errors = np.empty(len(level), dtype=np.float32)

    def judge(start: int, stop: int) -> None:
        _cells_kernel(
            (k, shape, level.first + start),
            (level.texels[start:stop], level.spots[start:stop], level.weights[start:stop]),
            (cells.children, cells.charts, cells.values),
            metric.arrays,
            errors[start:stop],
        )

    run_bands(judge, len(errors), band=1 << 14, threads=threads)
    return errors


def divide(
    level: Level, k: int, errors: FloatArray32, coverage: Coverage, texel_errors: FloatArray32
) -> BoolArray:
    """Decide which cells of the k-th level are divided; add what the others may be off by.

    A texel whose estimated error is above its bound has those cells divided that add more than an
    even share of half of it.
    """
    divided = np.zeros(len(level), dtype=np.bool_)
    _divide_kernel(
        k < LAST_LEVEL, (level.texels, level.weights), errors, coverage.counts, texel_errors,
        divided,
    )  # fmt: skip
    return divided


@kernel
def _find(shape, children, level, row, column):  # type: ignore[no-untyped-def]
    """Place of a cell of a level by its row and column of that level, `_NOWHERE` if not divided."""
    height, width = shape
    if row < 0 or column < 0 or row >= height << level or column >= width << level:
        return _NOWHERE
    place = (row >> level) * width + (column >> level)
    for k in range(level - 1, -1, -1):
        place = children[place]
        if place == NO_CHILD:
            return _NOWHERE
        place += ((row >> k) & 1) * 2 + ((column >> k) & 1)
    return place


@kernel
def _bend(metric, values, a, b, c):  # type: ignore[no-untyped-def]
    """Second difference of three values in a row; the first of two if c is nowhere; in bounds."""
    firsts, scales = metric
    worst = 0.0
    for k in range(len(scales)):
        square = 0.0
        for channel in range(firsts[k], firsts[k + 1]):
            d = float(values[a, channel]) - values[b, channel]
            if c != _NOWHERE:
                d += values[c, channel] - values[b, channel]
            square += d * d
        worst = max(worst, scales[k] * np.sqrt(square))
    return worst


@kernel
def _cells_kernel(size, level_cells, cells, metric, errors):  # type: ignore[no-untyped-def]
    level, shape, first = size
    texels, spots, weights = level_cells
    children, charts, values = cells
    width = shape[1]
    for i in range(len(texels)):
        errors[i] = 0.0
        if weights[i] == 0:
            continue
        place = first + i
        row = ((texels[i] // width) << level) + spots[i] // FINE
        column = ((texels[i] % width) << level) + spots[i] % FINE
        for axis in range(2):
            dy, dx = axis, 1 - axis
            before = _find(shape, children, level, row - dy, column - dx)
            after = _find(shape, children, level, row + dy, column + dx)
            if charts[place] == NO_CHART:
                # What of this cell is covered, if anything, is taken to be as its neighbors.
                for sign, near in ((-1, before), (1, after)):
                    if near == _NOWHERE or charts[near] == NO_CHART:
                        continue
                    far = _find(shape, children, level, row + 2 * sign * dy, column + 2 * sign * dx)
                    if far != _NOWHERE and charts[far] == charts[near]:
                        step = _bend(metric, values, near, far, _NOWHERE)
                        errors[i] = max(errors[i], _BORDER * step)
                continue
            has_before = before != _NOWHERE and charts[before] == charts[place]
            has_after = after != _NOWHERE and charts[after] == charts[place]
            if has_before and has_after:
                errors[i] += _BEND * _bend(metric, values, before, place, after)
            elif has_before or has_after:
                near, sign = (before, -1) if has_before else (after, 1)
                far = _find(shape, children, level, row + 2 * sign * dy, column + 2 * sign * dx)
                if far != _NOWHERE and charts[far] == charts[place]:
                    errors[i] += _BEND * _bend(metric, values, place, near, far)
                else:
                    errors[i] += _BORDER * _bend(metric, values, place, near, _NOWHERE)


@kernel
def _divide_kernel(may_divide, level, errors, counts, texel_errors, divided):  # type: ignore[no-untyped-def]
    texels, weights = level
    start = 0
    while start < len(texels):
        texel, stop = texels[start], start
        total, n_leaves = 0.0, 0
        while stop < len(texels) and texels[stop] == texel:
            total += weights[stop] * errors[stop]
            n_leaves += weights[stop] > 0
            stop += 1
        covered = float(counts[texel])
        too_far = may_divide and texel_errors[texel] + total / covered > 1.0
        for i in range(start, stop):
            error = weights[i] * errors[i] / covered
            if too_far and weights[i] > 1 and error * n_leaves > 0.5:
                divided[i] = True
            else:
                texel_errors[texel] += error
        start = stop
