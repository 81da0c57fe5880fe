"""Sums and squares of the samples of pixels, and error estimates derived from them.

Based on: Mitchell, "Generating antialiased images at low sampling densities", SIGGRAPH 1987, for
more samples where they differ; Roe, "Characteristic-based schemes for the Euler equations", Annual
Review of Fluid Mechanics 18, 1986, for the minmod slope, which is 0 next to a discontinuity.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

# Shading error relative to the second difference: 1/8 for a bend, up to 1/2 for a discontinuity.
_BEND = 0.25
_CHANGE = 0.7  # error relative to the last change by finer shading
# Edge error relative to the samples' standard deviation, and to the second difference of pixels.
_EDGE = 1.0
_HIDDEN = 0.5


@kernel
def add_fragments(pixels, counts, light, sums, squares, covered):  # type: ignore[no-untyped-def]
    """Add opaque fragments to their pixels, weighted by their numbers of samples."""
    for i in range(len(pixels)):
        pixel, count = pixels[i], np.float64(counts[i])
        for k in range(3):
            value = np.float64(light[i, k])
            sums[pixel, k] += count * value
            squares[pixel, k] += count * value * value
        sums[pixel, 3] += count
        squares[pixel, 3] += count
        covered[pixel] += counts[i]


@kernel
def add_samples(  # type: ignore[no-untyped-def]
    light, passed, seen, behind, first_row, side, sums, squares, covered
):
    """Add samples to their pixels, composited over the background."""
    for j in range(light.shape[0]):
        row = first_row + j // side
        for i in range(light.shape[1]):
            column = i // side
            y = row if behind.shape[0] > 1 else 0
            x = column if behind.shape[1] > 1 else 0
            through = np.float64(passed[j, i])
            for k in range(4):
                value = 1.0 - through
                if k < 3:
                    value = light[j, i, k] + through * behind[y, x, k]
                sums[row, column, k] += value
                squares[row, column, k] += value * value
            if seen[j, i]:
                covered[row, column] += np.float32(1.0)


@kernel
def write_window(  # type: ignore[no-untyped-def]
    mask, top, left, side, behind, is_opaque, shows_behind, light, squares, covered,
    light_out, squares_out, covered_out,
):  # fmt: skip
    """Write the sums of masked pixels; samples without a surface show the background."""
    n = np.float64(side * side)
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if not mask[row, column]:
                continue
            j, i = top + row, left + column
            y = row if behind.shape[0] > 1 else 0
            x = column if behind.shape[1] > 1 else 0
            passed = n - light[row, column, 3] if shows_behind else 0.0
            for k in range(4):
                back = np.float64(behind[y, x, k]) if k < 3 else 0.0
                light_out[j, i, k] = light[row, column, k] + passed * back
                squares_out[j, i, k] = squares[row, column, k] + passed * back * back
            if is_opaque:
                light_out[j, i, 3] = squares_out[j, i, 3] = n
            covered_out[j, i] = covered[row, column]


@kernel
def drop_unwanted(face_ids, mask, side):  # type: ignore[no-untyped-def]
    """Clear the samples of all pixels outside the mask."""
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if not mask[row, column]:
                for j in range(row * side, (row + 1) * side):
                    for i in range(column * side, (column + 1) * side):
                        face_ids[j, i] = -1


@kernel
def _coded(light):  # type: ignore[no-untyped-def]
    """Encode light as `texbake.texture.encoding.encode_srgb` does."""
    if light <= 0.0031308:
        return 12.92 * max(light, 0.0)
    return 1.0 if light >= 1.0 else 1.055 * light ** (1.0 / 2.4) - 0.055


@kernel
def write_codes(light, counts, codes, start, stop):  # type: ignore[no-untyped-def]
    """Write the encoded means of some rows of pixels."""
    for row in range(start, stop):
        for column in range(light.shape[1]):
            n = max(counts[row, column], 1)
            for k in range(3):
                codes[row, column, k] = _coded(light[row, column, k] / n)
            codes[row, column, 3] = light[row, column, 3] / n


@kernel
def _around(codes, row, column, axis, sign):  # type: ignore[no-untyped-def]
    """Return a neighboring pixel and True, or the pixel itself and False at the border."""
    j, i = row + sign * (1 - axis), column + sign * axis
    inside = 0 <= j < codes.shape[0] and 0 <= i < codes.shape[1]
    return (j, i, True) if inside else (row, column, False)


@kernel
def judge_shading(codes, shaded, changes, errors, start, stop):  # type: ignore[no-untyped-def]
    """Estimate the error of pixels due to too few shadings."""
    for row in range(start, stop):
        for column in range(codes.shape[1]):
            if shaded[row, column] > 1:
                # Root mean square of the changes of the pixel and its neighbors.
                total, weight = 0.0, 0
                for j in range(max(row - 1, 0), min(row + 2, codes.shape[0])):
                    for i in range(max(column - 1, 0), min(column + 2, codes.shape[1])):
                        if shaded[j, i] > 1:
                            total += changes[j, i] * changes[j, i]
                            weight += 1
                change = np.float64(changes[row, column])
                errors[row, column] = _CHANGE * max(change, math.sqrt(total / weight))
                continue
            # At the border of the picture the only difference counts once.
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
            # A pixel next to one that finer shading changed a lot may have a similar error.
            beside = 0.0
            for axis in range(2):
                for sign in (-1, 1):
                    j, i, _ = _around(codes, row, column, axis, sign)
                    beside = max(beside, np.float64(changes[j, i]))
            errors[row, column] = _BEND * max(worst, _CHANGE * beside)


@kernel
def judge_edges(light, squares, counts, errors, start, stop):  # type: ignore[no-untyped-def]
    """Estimate the error of pixels due to too few samples of their edges."""
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
                        # Subtract the variance explained by the smaller of the two slopes.
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
