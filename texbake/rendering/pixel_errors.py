"""How far the mean over the samples of each pixel may be from the mean over the pixel.

Two things can be wrong. What is shaded: a pixel that has been shaded in one cell is judged by those
beside it, by a quarter of the second difference, for where the picture bends by s at a line through
the pixel its middle is off by s / 8, and where it leaps by s by up to s / 2; one that has been
shaded in more cells, by what that changed. Cells four times as many leave errors half as great
where light is without any order, so the mean is off by about half the change, and chance is evened
out over the pixels around. And what is seen, where a pixel has edges: the mean over n x n samples
is off by up to half a row of them, but for most edges by about 0.6 sigma n^-3/2, with sigma the
deviation of the samples, less what the slope between the pixels around explains. An edge between
the samples of one pixel and of the next is seen in neither, but in the leap between them.

It is an estimate: what no sample of a pixel or of its neighbors meets is not seen.

Based on: Mitchell, "Generating antialiased images at low sampling densities", SIGGRAPH 1987, for
the second look where samples differ; Roe, "Characteristic-based schemes for the Euler equations",
1986, for the slope of least modulus, which is 0 beside a leap.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.pixel_sums import Float32Array, PixelSums

# Share of a second difference that a shading may be off by: between 1/8 of a bend, 1/2 of a leap.
_BEND = 0.25
# Of what finer shading changed.
_CHANGE = 0.7
# Of the deviation of the samples, and of the second difference to the pixels beside.
_EDGE = 1.0
_HIDDEN = 0.5
# Rows of pixels a band.
_ROWS = 32


def code_means(sums: PixelSums, codes: Float32Array, *, threads: int | None) -> None:
    """Write means as a file holds them: sRGB-coded light, and opacity as it is, (H, W, 4)."""

    def work(start: int, stop: int) -> None:
        _code_kernel(sums.light, sums.counts, codes, start, stop)

    run_bands(work, len(codes), band=_ROWS, threads=threads)


def shading_errors(
    codes: Float32Array, shaded: IntArray, changes: Float32Array, *, threads: int | None
) -> Float32Array:
    """(H, W) float32: how far coded means may be off by too few shadings.

    Parameters
    ----------
    codes : (H, W, 4) float32
    shaded : (H, W) int32
        Cells of each pixel along one side.
    changes : (H, W) float32
        How much the last finer shading changed a pixel; 0 where there was none.
    """
    errors = np.empty(shaded.shape, np.float32)

    def work(start: int, stop: int) -> None:
        _shading_kernel(codes, shaded, changes, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors


def edge_errors(sums: PixelSums, *, threads: int | None) -> Float32Array:
    """(H, W) float32: how far coded means may be off by too few samples."""
    errors = np.empty(sums.counts.shape, np.float32)

    def work(start: int, stop: int) -> None:
        _edges_kernel(sums.light, sums.squares, sums.counts, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors


@kernel
def _coded(light):  # type: ignore[no-untyped-def]
    """Light as `texbake.texture.encoding.encode_srgb` codes it."""
    if light <= 0.0031308:
        return 12.92 * max(light, 0.0)
    return 1.0 if light >= 1.0 else 1.055 * light ** (1.0 / 2.4) - 0.055


@kernel
def _code_kernel(light, counts, codes, start, stop):  # type: ignore[no-untyped-def]
    for row in range(start, stop):
        for column in range(light.shape[1]):
            n = max(counts[row, column], 1)
            for k in range(3):
                codes[row, column, k] = _coded(light[row, column, k] / n)
            codes[row, column, 3] = light[row, column, 3] / n


@kernel
def _around(codes, row, column, axis, sign):  # type: ignore[no-untyped-def]
    """Row and column of the pixel beside one, and whether there is one; else the pixel itself."""
    j, i = row + sign * (1 - axis), column + sign * axis
    inside = 0 <= j < codes.shape[0] and 0 <= i < codes.shape[1]
    return (j, i, True) if inside else (row, column, False)


@kernel
def _shading_kernel(codes, shaded, changes, errors, start, stop):  # type: ignore[no-untyped-def]
    for row in range(start, stop):
        for column in range(codes.shape[1]):
            if shaded[row, column] > 1:
                # Root mean square of what changed the pixel and those around.
                total, weight = 0.0, 0
                for j in range(max(row - 1, 0), min(row + 2, codes.shape[0])):
                    for i in range(max(column - 1, 0), min(column + 2, codes.shape[1])):
                        if shaded[j, i] > 1:
                            total += changes[j, i] * changes[j, i]
                            weight += 1
                change = np.float64(changes[row, column])
                errors[row, column] = _CHANGE * max(change, math.sqrt(total / weight))
                continue
            # At the border of the picture the one difference there is counts once.
            worst = 0.0
            for k in range(4):
                bend = 0.0
                for axis in range(2):
                    second = 0.0
                    for sign in (-1, 1):
                        j, i, _ = _around(codes, row, column, axis, sign)
                        second += np.float64(codes[j, i, k]) - np.float64(codes[row, column, k])
                    bend += abs(second)
                worst = max(worst, bend)
            # A pixel beside one that finer shading changed much may hide as much itself.
            beside = 0.0
            for axis in range(2):
                for sign in (-1, 1):
                    j, i, _ = _around(codes, row, column, axis, sign)
                    beside = max(beside, np.float64(changes[j, i]))
            errors[row, column] = _BEND * max(worst, _CHANGE * beside)


@kernel
def _edges_kernel(light, squares, counts, errors, start, stop):  # type: ignore[no-untyped-def]
    for row in range(start, stop):
        for column in range(light.shape[1]):
            n = np.float64(max(counts[row, column], 1))
            share = n**-0.75
            error = 0.0
            for k in range(4):
                mean = light[row, column, k] / n
                variance = squares[row, column, k] / n - mean * mean
                hidden = 0.0
                for axis in range(2):
                    j, i, before = _around(light, row, column, axis, -1)
                    first = mean - light[j, i, k] / max(counts[j, i], 1)
                    j, i, after = _around(light, row, column, axis, 1)
                    second = light[j, i, k] / max(counts[j, i], 1) - mean
                    if before and after:
                        hidden = max(hidden, abs(second - first))
                    if first * second > 0.0:
                        # The lesser of the slopes to either side explains this much of it.
                        slope = min(abs(first), abs(second))
                        variance -= (1.0 - 1.0 / n) / 12.0 * slope * slope
                off = share * (_EDGE * math.sqrt(max(variance, 0.0)) + _HIDDEN * hidden)
                if off == 0.0:
                    continue
                if k == 3:
                    error = max(error, off)
                    continue
                middle = _coded(mean)
                error = max(error, _coded(mean + off) - middle, middle - _coded(mean - off))
            errors[row, column] = error
