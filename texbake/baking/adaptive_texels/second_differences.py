"""Second differences of values between texels that lie side by side, and errors judged by them.

Only texels that are wholly covered have their sample at their center, and so show how values
change; those of other charts, and those without a value, show nothing.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980: more samples where those at hand differ.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.adaptive_texels.edge_functions import FULL
from texbake.baking.adaptive_texels.quadtree import NO_CHART, PER_TEXEL, sample_spot
from texbake.kernels import kernel

BOTH, ONE_SIDE, NEXT, NOTHING = 2, 1, 0, -1  # what lies along an axis; see `along`
_TOWARDS = 1.0 / 18.0  # share of the second differences that is added to a sample
_DEVIATION = 2.0  # second differences that one deviation from an even change counts as
_PARTLY = 2.5  # a partly covered texel is so many times as far off, by measurement


@kernel
def is_surrounded(shape, texels, texel):  # type: ignore[no-untyped-def]
    """Whether the texels on all four sides are wholly covered, by the same chart."""
    height, width = shape
    counts, charts = texels
    chart = charts[texel]
    # The texel beside one at the left or right border is one of another row: tested last.
    return (
        width <= texel < (height - 1) * width
        and counts[texel - 1] + counts[texel + 1] == 2 * FULL
        and counts[texel - width] + counts[texel + width] == 2 * FULL
        and charts[texel - 1] == chart
        and charts[texel + 1] == chart
        and charts[texel - width] == chart
        and charts[texel + width] == chart
        and 0 < np.uint32(texel) % np.uint32(width) < width - 1
    )


@kernel
def along(shape, texels, texel, axis):  # type: ignore[no-untyped-def]
    """Find wholly covered texels of the same chart along an axis (0: x, 1: y).

    Returns
    -------
    kind, a, b
        `BOTH`: a before it and b after it; `ONE_SIDE`: a beside it and b beyond a; `NEXT`: only a
        beside it; `NOTHING`.
    """
    height, width = shape
    n_texels = height * width
    counts, charts = texels
    chart = charts[texel]
    stride = 1 if axis == 0 else width
    before, after = texel - stride, texel + stride
    has_before = before >= 0 and charts[before] == chart and counts[before] == FULL
    has_after = after < n_texels and charts[after] == chart and counts[after] == FULL
    if axis == 0 and (has_before or has_after):
        column = texel % width
        has_before = has_before and column > 0
        has_after = has_after and column + 1 < width
    if has_before and has_after:
        return BOTH, before, after
    if not has_before and not has_after:
        return NOTHING, texel, texel
    near = before if has_before else after
    far = 2 * near - texel
    is_there = 0 <= far < n_texels and charts[far] == chart and counts[far] == FULL
    if is_there and (axis == 1 or far // width == texel // width):
        return ONE_SIDE, near, far
    return NEXT, near, near


@kernel
def second_difference(values, texel, kind, a, b, channel):  # type: ignore[no-untyped-def]
    """Return the second difference of one channel along an axis, or else the first."""
    v, va, vb = values[texel, channel], values[a, channel], values[b, channel]
    if kind == BOTH:
        return float(va) + vb - 2.0 * v
    if kind == ONE_SIDE:
        return float(v) + vb - 2.0 * va
    return float(va) - v


@kernel
def _is_whole(texels, texel, chart):  # type: ignore[no-untyped-def]
    """Whether a texel is wholly covered, by some chart."""
    counts, charts = texels
    return counts[texel] == FULL and charts[texel] == chart


@kernel
def inner_texel(shape, texels, texel):  # type: ignore[no-untyped-def]
    """Return a wholly covered texel of the same chart at a side or a corner of a texel, or -1.

    A wholly covered texel is its own inner texel.
    """
    height, width = shape
    chart = texels[1][texel]
    if _is_whole(texels, texel, chart):
        return texel
    row, column = texel // width, texel % width
    for is_corner in range(2):
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if abs(dy) + abs(dx) != 1 + is_corner:
                    continue
                if 0 <= row + dy < height and 0 <= column + dx < width:
                    other = texel + dy * width + dx
                    if _is_whole(texels, other, chart):
                        return other
    return -1


@kernel
def write_slopes(shape, texels, values, texel, slopes):  # type: ignore[no-untyped-def]
    """Write how much each channel changes from texel to texel, to the right and down: (2, C)."""
    for axis in range(2):
        kind, a, b = along(shape, texels, texel, axis)
        for channel in range(values.shape[1]):
            slope = 0.0
            if kind == BOTH:
                slope = 0.5 * (float(values[b, channel]) - values[a, channel])
            elif kind != NOTHING:
                slope = float(values[a, channel]) - values[texel, channel]
                slope = slope if a > texel else -slope
            slopes[axis, channel] = slope


@kernel
def deviation(metric, values, place, origin, slopes, dx, dy, k):  # type: ignore[no-untyped-def]
    """Return how far a value of the k-th map is from an even change, in bounds of the map."""
    firsts, scales = metric
    square = 0.0
    for channel in range(firsts[k], firsts[k + 1]):
        even = values[origin, channel] + dx * slopes[0, channel] + dy * slopes[1, channel]
        square += (values[place, channel] - even) ** 2
    return scales[k] * np.sqrt(square)


@kernel
def judge_samples(size, counts, seen, metric, steps, means):  # type: ignore[no-untyped-def]
    """Judge texels from `first` on; partly covered ones get -1."""
    shape, first = size
    charts, values = seen
    texels = (counts, charts)
    for i in range(len(steps)):
        texel = first + i
        steps[i] = 0.0
        if counts[texel] == 0:
            continue
        if charts[texel] == NO_CHART:
            if counts[texel] < FULL or _has_neighbor(shape, charts, texel):
                steps[i] = np.inf
            continue
        if counts[texel] < FULL:
            steps[i] = -1.0
            for channel in range(values.shape[1]):
                means[i, channel] = values[texel, channel]
            continue
        if is_surrounded(shape, texels, texel):
            steps[i] = _judge_inside(values, shape[1], metric, texel, means[i])
            continue
        x, y = along(shape, texels, texel, 0), along(shape, texels, texel, 1)
        steps[i] = _judge_border(values, metric, texel, x, y, means[i])
        if x[0] == NOTHING or y[0] == NOTHING:
            steps[i] = np.inf


@kernel
def _judge_inside(values, width, metric, texel, mean):  # type: ignore[no-untyped-def]
    """Do what `_judge_border` does, faster, for a texel with neighbors on all sides."""
    firsts, scales = metric
    steps = 0.0
    for k in range(len(scales)):
        # A map without a bound may hold anything, such as colors or ids, and is left alone.
        towards = np.float32(_TOWARDS if scales[k] > 0.0 else 0.0)
        square_x, square_y = np.float32(0.0), np.float32(0.0)
        for channel in range(firsts[k], firsts[k + 1]):
            v = values[texel, channel]
            x = values[texel - 1, channel] - v + (values[texel + 1, channel] - v)
            y = values[texel - width, channel] - v + (values[texel + width, channel] - v)
            square_x += x * x
            square_y += y * y
            mean[channel] = v + towards * (x + y)
        steps = max(steps, scales[k] * (np.sqrt(square_x) + np.sqrt(square_y)))
    return steps


@kernel
def _judge_border(values, metric, texel, x, y, mean):  # type: ignore[no-untyped-def]
    """Write the mean of a wholly covered texel; return its second differences, in bounds."""
    firsts, scales = metric
    # A map without a bound may hold anything, such as colors or ids, and is left alone.
    towards_x = _TOWARDS if x[0] > NEXT else 0.0
    towards_y = _TOWARDS if y[0] > NEXT else 0.0
    steps = 0.0
    for k in range(len(scales)):
        square_x, square_y = 0.0, 0.0
        for channel in range(firsts[k], firsts[k + 1]):
            v = values[texel, channel]
            if scales[k] > 0.0:
                bend_x = second_difference(values, texel, x[0], x[1], x[2], channel)
                bend_y = second_difference(values, texel, y[0], y[1], y[2], channel)
                square_x += bend_x * bend_x
                square_y += bend_y * bend_y
                v += towards_x * bend_x + towards_y * bend_y
            mean[channel] = v
        steps = max(steps, scales[k] * (np.sqrt(square_x) + np.sqrt(square_y)))
    return steps


@kernel
def _has_neighbor(shape, charts, texel):  # type: ignore[no-untyped-def]
    """Whether a texel on any of the four sides has a value."""
    height, width = shape
    row, column = texel // width, texel % width
    return (
        (column > 0 and charts[texel - 1] != NO_CHART)
        or (column + 1 < width and charts[texel + 1] != NO_CHART)
        or (row > 0 and charts[texel - width] != NO_CHART)
        or (row + 1 < height and charts[texel + width] != NO_CHART)
    )


@kernel
def judge_partly_covered(shape, coverage, seen, metric, steps, parts, judged, slopes):  # type: ignore[no-untyped-def]
    """Judge partly covered texels by the wholly covered ones beside them."""
    charts, values = seen
    counts, masks = coverage
    texels = (counts, charts)
    width = shape[1]
    for i in range(len(parts)):
        texel = parts[i]
        judged[i] = 0.0
        if masks[texel] == 0:
            continue  # no sample could lie anywhere but at its center
        inner = inner_texel(shape, texels, texel)
        if inner < 0:
            judged[i] = np.inf
            continue
        x, y = sample_spot(coverage, texel, 0, 0)
        dx = texel % width - inner % width + x / PER_TEXEL - 0.5
        dy = texel // width - inner // width + y / PER_TEXEL - 0.5
        write_slopes(shape, texels, values, inner, slopes)
        away = 0.0
        for k in range(len(metric[1])):
            away = max(away, deviation(metric, values, texel, inner, slopes, dx, dy, k))
        judged[i] = _PARTLY * max(steps[inner], _DEVIATION * away)
