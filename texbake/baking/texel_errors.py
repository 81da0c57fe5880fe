"""How far the one sample of a texel may be from its mean, judged by the texels beside it.

What is looked at is the second difference s along each axis, from the texels on both sides or, at
the border of a chart, from two on one side. A value that bends by s at a line through the center
has a mean that is off by s / 8, one that leaps by s, by up to s / 2, and one that curves evenly, by
s / 24, always towards the neighbors. So a share of s is added to the sample: over bends at random
places 1 / 18 leaves the least squares, and values that curve evenly keep a third of their error.

Texels that are covered in part cannot say how values change, being sampled off their centers. They
have what the whole ones beside them say, and by how much they are off from going on evenly.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", 1980, as `cells` is; the
shares are those of straight lines through squares, by integration.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.cell_samples import PER_TEXEL, sample_spot
from texbake.baking.cells import NO_CHART, Cells, FloatArray32
from texbake.baking.coverage import FULL, Coverage
from texbake.baking.neighbors import (
    NEXT,
    NOTHING,
    Metric,
    along,
    astray,
    inner_texel,
    is_surrounded,
    second_difference,
    write_slopes,
)
from texbake.kernels import kernel
from texbake.parallel import run_bands

# What one sample may be off by, in second differences.
ONE_SAMPLE = np.float32(0.2)
_TOWARDS = 1.0 / 18.0  # share of second differences that is added to a sample
_ASTRAY = 2.0  # second differences that a value counts as by how far it is from going on evenly
_PART = 2.5  # times as far off is a texel that is covered in part, by measurement
_BAND = 1 << 15


def judge_texels(
    cells: Cells, coverage: Coverage, shape: tuple[int, int], metric: Metric, threads: int | None
) -> tuple[FloatArray32, FloatArray32]:
    """Estimate means from one sample a texel, and how evenly values change there.

    Returns
    -------
    means : (n_texels, C) float32
        0 where there is no value.
    steps : (n_texels,) float32
        Second differences in bounds, both axes together, of the map where they are greatest. They
        are infinite where nothing is known and there may be more to see.
    """
    n, n_channels = shape[0] * shape[1], cells.values.shape[1]
    means = np.zeros((n, n_channels), dtype=np.float32)
    steps = np.empty(n, dtype=np.float32)
    seen = (cells.charts, cells.values)

    def judge(start: int, stop: int) -> None:
        _texels_kernel(
            (shape, start), coverage.counts, seen, metric.arrays, steps[start:stop],
            means[start:stop],
        )  # fmt: skip

    run_bands(judge, n, band=_BAND, threads=threads)
    parts = np.flatnonzero(steps < 0.0)
    found = np.empty(len(parts), dtype=np.float32)

    def judge_parts(start: int, stop: int) -> None:
        _parts_kernel(
            shape, (coverage.counts, coverage.masks), seen, metric.arrays, steps,
            parts[start:stop], found[start:stop], np.empty((2, n_channels)),
        )  # fmt: skip

    run_bands(judge_parts, len(parts), band=1 << 12, threads=threads)
    steps[parts] = found
    return means, steps


@kernel
def _texels_kernel(size, counts, seen, metric, steps, means):  # type: ignore[no-untyped-def]
    """Judge texels from `first` on; -1 for those that are covered in part."""
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
    """Do what `_judge_border` does, quicker, for a texel with neighbors on all sides."""
    firsts, scales = metric
    steps = 0.0
    for k in range(len(scales)):
        # What is not bounded may be anything, a color or a number, and is left alone.
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
    """Write the mean of a whole texel; return its second differences, in bounds."""
    firsts, scales = metric
    # What is not bounded may be anything, a color or a number, and is left alone.
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
    height, width = shape
    row, column = texel // width, texel % width
    return (
        (column > 0 and charts[texel - 1] != NO_CHART)
        or (column + 1 < width and charts[texel + 1] != NO_CHART)
        or (row > 0 and charts[texel - width] != NO_CHART)
        or (row + 1 < height and charts[texel + width] != NO_CHART)
    )


@kernel
def _parts_kernel(shape, coverage, seen, metric, steps, parts, found, slopes):  # type: ignore[no-untyped-def]
    charts, values = seen
    counts, masks = coverage
    texels = (counts, charts)
    width = shape[1]
    for i in range(len(parts)):
        texel = parts[i]
        found[i] = 0.0
        if masks[texel] == 0:
            continue  # its center is all that any sample can see
        inner = inner_texel(shape, texels, texel)
        if inner < 0:
            found[i] = np.inf
            continue
        x, y = sample_spot(coverage, texel, 0, 0)
        dx = texel % width - inner % width + x / PER_TEXEL - 0.5
        dy = texel // width - inner // width + y / PER_TEXEL - 0.5
        write_slopes(shape, texels, values, inner, slopes)
        away = 0.0
        for k in range(len(metric[1])):
            away = max(away, astray(metric, values, texel, inner, slopes, dx, dy, k))
        found[i] = _PART * max(steps[inner], _ASTRAY * away)
