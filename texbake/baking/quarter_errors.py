"""How far four samples of a texel may be from its mean, judged by the first and those beside it.

They are held against what the texel's first sample and its neighbors say of how values change.
Where they go on evenly from there, their mean with a share of both says more than either: shares
that leave the least squares over the maps of scans.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", 1980, as `cells` is.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.cell_samples import PER_TEXEL, sample_spot, submask
from texbake.baking.cells import Cells, FloatArray32
from texbake.baking.coverage import FINE, FULL, Coverage
from texbake.baking.neighbors import (
    NEXT,
    Metric,
    along,
    astray,
    inner_texel,
    is_surrounded,
    second_difference,
    write_slopes,
)
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

# What the mean of four samples is off by: of second differences, of how far the four together are
# astray, and of how much farther that is than `_LEAP` second differences, as bends never are.
_EVEN, _UNEVEN, _UNSTEADY = 0.01, 0.05, 0.15
_LEAP = 0.6
# Shares of the first sample and of second differences in the mean of a texel with four more.
_FIRST, _TOWARDS = 0.1, 0.016


def judge_quarters(
    cells: Cells, coverage: Coverage, shape: tuple[int, int], metric: Metric, steps: FloatArray32,
    parents: IntArray, means: FloatArray32, threads: int | None,
) -> FloatArray32:  # fmt: skip
    """Estimated errors of texels with four samples, in bounds; write their means.

    Parameters
    ----------
    parents : (n,) int32
        Texels, whose children have samples.
    """
    errors = np.empty(len(parents), dtype=np.float32)
    n_channels = cells.values.shape[1]

    def judge(start: int, stop: int) -> None:
        _quarters_kernel(
            shape, (coverage.counts, coverage.masks), (cells.charts, cells.values),
            metric.arrays, steps, (parents[start:stop], cells.children), means,
            errors[start:stop], (np.empty((2, n_channels)), np.empty((5, 2)), np.empty(4)),
        )  # fmt: skip

    run_bands(judge, len(parents), band=1 << 13, threads=threads)
    return errors


@kernel
def _quarters_kernel(  # type: ignore[no-untyped-def]
    shape, coverage, seen, metric, steps, family, means, errors, scratch
):
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
            _mend_mean(shape, texels, values, texel, metric, means)
        # How far the four are astray from the first, each from where that lies.
        worst = 0.0
        for k in range(len(metric[1])):
            away = 0.0
            for child in range(4):
                if weights[child] > 0.0:
                    dx, dy = spots[child, 0] - spots[4, 0], spots[child, 1] - spots[4, 1]
                    away += astray(metric, values, first + child, texel, slopes, dx, dy, k)
            worst = max(worst, 4.0 * away / n)
        errors[i] = _expected(steps[texel], worst)


@kernel
def _expected(steps, away):  # type: ignore[no-untyped-def]
    return _EVEN * steps + _UNEVEN * away + _UNSTEADY * max(away - _LEAP * steps, 0.0)


@kernel
def _is_inside(shape, texels, texel, first):  # type: ignore[no-untyped-def]
    """Whether the quarters and all neighbors of a whole texel are of its chart."""
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
    """Do what is done at borders, quicker, for a texel that `_is_inside`.

    Returns how far the four together are astray, in bounds.
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
            # a quarter of the slopes
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
    """Write where the samples of four quarters lie, last the texel's own, and what they cover."""
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
    """Write the mean of a texel's quarters by what they cover."""
    total = weights[0] + weights[1] + weights[2] + weights[3]
    for channel in range(values.shape[1]):
        mean = 0.0
        for child in range(4):
            if weights[child] > 0.0:
                mean += weights[child] * values[first + child, channel]
        means[texel, channel] = mean / total


@kernel
def _mend_mean(shape, texels, values, texel, metric, means):  # type: ignore[no-untyped-def]
    """Add shares of the first sample and of second differences to the mean of a whole texel."""
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
            mended = mean + _FIRST * (values[texel, channel] - mean) + _TOWARDS * bend
            means[texel, channel] = mended
