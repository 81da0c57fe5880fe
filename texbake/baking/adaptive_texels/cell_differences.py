"""Errors of divided texels, judged by the differences between their cells and those beside them.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980: more samples where those at hand differ.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.adaptive_texels.edge_functions import FINE, FULL
from texbake.baking.adaptive_texels.quadtree import (
    NO_CHART,
    NO_CHILD,
    PER_TEXEL,
    sample_spot,
    submask,
)
from texbake.baking.adaptive_texels.second_differences import (
    NEXT,
    along,
    deviation,
    inner_texel,
    is_surrounded,
    second_difference,
    write_slopes,
)
from texbake.kernels import kernel

# What the mean of four samples may be off by: shares of second differences, of how far the four
# together deviate from an even change, and of how far that exceeds `_LEAP` second differences,
# which it never does where values merely bend.
_EVEN, _UNEVEN, _UNSTEADY = 0.01, 0.05, 0.15
_LEAP = 0.6
# Shares of the first sample and of second differences in the mean of a texel with four more.
_FIRST, _TOWARDS = 0.1, 0.016
# Share of a second difference that a sample of a cell may be off by: 1/8 for a bend, and a little
# more for leaps, whose 1/2 has either sign in the cells along them.
_BEND = 0.15
_BORDER = 0.25  # share of a first difference, at a border
_NOWHERE = -1


@kernel
def judge_four_samples(  # type: ignore[no-untyped-def]
    shape, coverage, seen, metric, steps, family, means, errors, scratch
):
    """Judge texels by their four samples and those beside them, and write their means."""
    charts, values = seen
    counts, _ = coverage
    parents, children = family
    slopes, spots, weights = scratch
    texels = (counts, charts)
    for i in range(len(parents)):
        texel = parents[i]
        first = children[texel]
        if _is_inside(shape, texels, texel, first):
            away = _judge_inside(values, shape[1], metric, texel, first, means[texel])
            errors[i] = _expected(steps[texel], away)
            continue
        errors[i] = np.inf
        n, is_same = 0, True
        _write_spots(coverage, texel, spots, weights)
        for child in range(4):
            if weights[child] > 0.0:
                n += 1
                is_same = is_same and charts[first + child] == charts[texel]
        inner = inner_texel(shape, texels, texel)
        if n == 0 or not is_same or inner < 0:
            continue
        write_slopes(shape, texels, values, inner, slopes)
        _write_mean(values, texel, first, weights, means)
        if counts[texel] == FULL:
            _adjust_mean(shape, texels, values, texel, metric, means)
        # How far the four deviate from an even change from the first sample.
        worst = 0.0
        for k in range(len(metric[1])):
            away = 0.0
            for child in range(4):
                if weights[child] > 0.0:
                    dx, dy = spots[child, 0] - spots[4, 0], spots[child, 1] - spots[4, 1]
                    away += deviation(metric, values, first + child, texel, slopes, dx, dy, k)
            worst = max(worst, 4.0 * away / n)
        errors[i] = _expected(steps[texel], worst)


@kernel
def _expected(steps, away):  # type: ignore[no-untyped-def]
    """Return how far the mean of four samples is expected to be off, in bounds."""
    return _EVEN * steps + _UNEVEN * away + _UNSTEADY * max(away - _LEAP * steps, 0.0)


@kernel
def _is_inside(shape, texels, texel, first):  # type: ignore[no-untyped-def]
    """Whether the quarters and all neighbors of a wholly covered texel are of its chart."""
    counts, charts = texels
    chart = charts[texel]
    return (
        counts[texel] == FULL
        and charts[first] == chart
        and charts[first + 1] == chart
        and charts[first + 2] == chart
        and charts[first + 3] == chart
        and is_surrounded(shape, texels, texel)
    )


@kernel
def _judge_inside(values, width, metric, texel, first, mean):  # type: ignore[no-untyped-def]
    """Do what is done at borders, faster, for a texel that `_is_inside`.

    Returns how far the four together deviate from an even change, in bounds.
    """
    firsts, scales = metric
    worst = 0.0
    for k in range(len(scales)):
        is_bounded = scales[k] > 0.0
        square_a, square_b, square_c, square_d = 0.0, 0.0, 0.0, 0.0
        for channel in range(firsts[k], firsts[k + 1]):
            v = float(values[texel, channel])
            left, right = values[texel - 1, channel] - v, values[texel + 1, channel] - v
            up, down = values[texel - width, channel] - v, values[texel + width, channel] - v
            a, b = values[first, channel] - v, values[first + 1, channel] - v
            c, d = values[first + 2, channel] - v, values[first + 3, channel] - v
            mean_away = 0.25 * (a + b + c + d)
            if is_bounded:
                bend = left + right + up + down
                mean[channel] = v + (1.0 - _FIRST) * mean_away + _TOWARDS * bend
            else:
                mean[channel] = v + mean_away
            # A quarter of the slopes.
            x, y = 0.125 * (right - left), 0.125 * (down - up)
            square_a += (a + x + y) ** 2
            square_b += (b - x + y) ** 2
            square_c += (c + x - y) ** 2
            square_d += (d - x - y) ** 2
        away = np.sqrt(square_a) + np.sqrt(square_b) + np.sqrt(square_c) + np.sqrt(square_d)
        worst = max(worst, scales[k] * away)
    return worst


@kernel
def _write_spots(coverage, texel, spots, weights):  # type: ignore[no-untyped-def]
    """Write where the samples of four quarters and of their texel lie, and how much they cover."""
    counts, masks = coverage
    is_whole = counts[texel] == FULL
    for child in range(4):
        spot = (child // 2) * FINE + child % 2
        if is_whole:
            weights[child] = FULL // 4
            spots[child, 0], spots[child, 1] = 0.25 + 0.5 * (child % 2), 0.25 + 0.5 * (child // 2)
        else:
            weights[child] = submask(masks, texel, 1, spot)[0]
            x, y = sample_spot(coverage, texel, 1, spot)
            spots[child, 0], spots[child, 1] = x / PER_TEXEL, y / PER_TEXEL
    x, y = sample_spot(coverage, texel, 0, 0)
    spots[4, 0], spots[4, 1] = x / PER_TEXEL, y / PER_TEXEL


@kernel
def _write_mean(values, texel, first, weights, means):  # type: ignore[no-untyped-def]
    """Write the mean of a texel's quarters, each by how much of it is covered."""
    total = weights[0] + weights[1] + weights[2] + weights[3]
    for channel in range(values.shape[1]):
        mean = 0.0
        for child in range(4):
            if weights[child] > 0.0:
                mean += weights[child] * values[first + child, channel]
        means[texel, channel] = mean / total


@kernel
def _adjust_mean(shape, texels, values, texel, metric, means):  # type: ignore[no-untyped-def]
    """Add shares of the first sample and of second differences to a wholly covered texel's mean."""
    firsts, scales = metric
    kind_x, xa, xb = along(shape, texels, texel, 0)
    kind_y, ya, yb = along(shape, texels, texel, 1)
    for k in range(len(scales)):
        if scales[k] == 0.0:
            continue
        for channel in range(firsts[k], firsts[k + 1]):
            bend = 0.0
            if kind_x > NEXT:
                bend += second_difference(values, texel, kind_x, xa, xb, channel)
            if kind_y > NEXT:
                bend += second_difference(values, texel, kind_y, ya, yb, channel)
            mean = means[texel, channel]
            adjusted = mean + _FIRST * (values[texel, channel] - mean) + _TOWARDS * bend
            means[texel, channel] = adjusted


@kernel
def _find(shape, children, level, row, column):  # type: ignore[no-untyped-def]
    """Return the place of a cell by its row and column of a level, `_NOWHERE` if there is none."""
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
    """Return the second difference of three values in bounds; the first of two without c."""
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
def judge_cell_samples(size, level_cells, cells, metric, errors):  # type: ignore[no-untyped-def]
    """Judge the cells of a level by those on their four sides."""
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
                # Whatever of this cell is covered is taken to be like its neighbors.
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
def choose_divided(may_divide, level, errors, counts, texel_errors, divided):  # type: ignore[no-untyped-def]
    """Mark the cells that are divided; add the errors of the others to their texels."""
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
