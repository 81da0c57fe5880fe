"""Kernels of checkers, stripes, marble, wood and granite, and of the pulses that they are made of.

A pulse is a pattern along one coordinate with the period 1 and values from 0 to 1; `width` is the
share of a period, above 0 and below 1:

- `HARD`: 1 over the first `width` of the period, then 0.
- `SINE`: half a wave above 1/2 over the first `width`, half a wave below it over the rest; a sine
  where `width` is 1/2.
- `RAMP`: straight up to 1 over the first `width`, straight down to 0 over the rest.

The mean of a pulse over an interval is the difference of its integral at the ends divided by the
length, which is exact: edges finer than a pixel become the right gray. `box_mean` and `write_color`
are made to be called from other kernels. The formulas of the patterns are in `patterns`.

Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11 (the filtered pulse train).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.procedures.noise_kernels import (
    contrast_kept,
    noise_at,
    octave_sum,
    point_coordinates,
    span_along,
    widest,
    width_along,
)

HARD = 0
SINE = 1
RAMP = 2

# Of a period. Points on a face that lies in an edge of a hard pattern, whose coordinates are
# rounded either way, all count as just above the edge.
_NUDGE = 2.0**-30

# Shorter intervals are points: within them no mean differs from the value by more than 2^-19, and
# the difference of integrals would lose its last digits.
_SHORTEST = 2.0**-20


@kernel
def box_mean(pattern, width, phase, span):  # type: ignore[no-untyped-def]
    """Mean of a pattern over `phase` ± `span` / 2, in periods; its value where the span is 0."""
    if pattern == HARD:
        phase += _NUDGE
    if not span > _SHORTEST:
        return _pulse(pattern, width, phase - np.floor(phase))
    start = phase - 0.5 * span
    start -= np.floor(start)
    end = start + span
    periods = np.floor(end)
    area = periods * _pulse_integral(pattern, width, 1.0) + _pulse_integral(
        pattern, width, end - periods
    )
    return min(max((area - _pulse_integral(pattern, width, start)) / span, 0.0), 1.0)


@kernel
def _pulse(pattern, width, t):  # type: ignore[no-untyped-def]
    if pattern == HARD:
        return 1.0 if t < width else 0.0
    if t < width:
        t /= width
        return 0.5 + 0.5 * np.sin(np.pi * t) if pattern == SINE else t
    t = (1.0 - t) / (1.0 - width)
    return 0.5 - 0.5 * np.sin(np.pi * t) if pattern == SINE else t


@kernel
def _pulse_integral(pattern, width, t):  # type: ignore[no-untyped-def]
    """Integral of a pattern from 0 to t, in [0, 1]."""
    first = min(t, width)
    if pattern == HARD:
        return first
    rest = max(t - width, 0.0)
    other = 1.0 - width
    if pattern == SINE:
        above = width * (1.0 - np.cos(np.pi * first / width))
        below = other * (1.0 - np.cos(np.pi * rest / other))
        return 0.5 * t + 0.5 * (above - below) / np.pi
    return 0.5 * first * first / width + rest - 0.5 * rest * rest / other


@kernel
def write_color(out, i, value, sharp, kept, stops, mean_color):  # type: ignore[no-untyped-def]
    """Write row i: `value`, or the color of `sharp`, of whose contrast `kept` is left.

    Parameters
    ----------
    out : (n, 1 or 3) float32
        Written: one channel is the value, three are the color.
    value, sharp : float
        The filtered value, and the one whose color is looked up; clamped to [0, 1].
    kept : float
        1: the color itself, 0: `mean_color`.
    """
    if out.shape[1] == 1:
        out[i, 0] = min(max(value, 0.0), 1.0)
        return
    place = min(max(sharp, 0.0), 1.0) * (len(stops) - 1)
    below = min(int(place), len(stops) - 2)
    along = place - below
    for channel in range(3):
        low, mean = stops[below, channel], mean_color[channel]
        color = low + along * (stops[below + 1, channel] - low)
        out[i, channel] = mean + kept * (color - mean)


@kernel
def checker_kernel(points, widths, n_dimensions, out, start, stop):  # type: ignore[no-untyped-def]
    """A checker of unit squares or cubes, averaged over each pixel."""
    for i in range(start, stop):
        place = point_coordinates(points, i)
        sign = 1.0
        for axis in range(n_dimensions):
            # A coordinate that points do not have is 0 all over the pixel.
            span = width_along(widths, i, axis) if axis < points.shape[1] else 0.0
            sign *= 2.0 * box_mean(HARD, 0.5, 0.5 * place[axis], 0.5 * span) - 1.0
        out[i, 0] = 0.5 + 0.5 * sign


@kernel
def stripes_kernel(points, widths, pattern, width, direction, out, start, stop):  # type: ignore[no-untyped-def]
    """Stripes across a direction, averaged over each pixel."""
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        along = direction[0] * x + direction[1] * y + direction[2] * z
        out[i, 0] = box_mean(pattern, width, along, span_along(widths, i, direction))


@kernel
def marble_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, numbers, direction, stops, mean_color,
    out, start, stop,
):  # fmt: skip
    """Layers across a direction, bent by turbulence."""
    k1, k2, amount, lacunarity, gain, mean, variance = numbers
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        total, lost = octave_sum(
            permutation, slopes, quintic, octaves, (lacunarity, gain), mean, x * k2, y * k2, z * k2,
            widest(widths, i) * k2,
        )  # fmt: skip
        along = direction[0] * x + direction[1] * y + direction[2] * z
        layer = np.sin(k1 * along + amount * total)
        kept = np.exp(-0.5 * amount * amount * variance * lost)
        half = 0.5 * k1 * span_along(widths, i, direction)
        if half > 0.0:
            # Beyond one whole period the mean of a sine swings about 0; there it stays 0.
            kept *= np.sin(half) / half if half < np.pi else 0.0
        write_color(out, i, 0.5 + 0.5 * kept * layer, 0.5 + 0.5 * layer, kept, stops, mean_color)


# Share of a ring that grows darker.
_RISE = 0.8

# Cells of noise a ring, across the axis and along it: rings bend over several of their widths and
# hardly along the trunk; fibers are thin and long.
_BEND_CELLS = (0.2, 0.05)
_FIBER_CELLS = (5.0, 0.12)


@kernel
def _drawn_noise(permutation, slopes, quintic, across, along, axis, cells, width):  # type: ignore[no-untyped-def]
    """Noise with so many cells a ring across and along the axis, faded by the pixel's width."""
    kept = contrast_kept(width * cells[0])
    if kept == 0.0:
        return 0.0
    return kept * noise_at(
        permutation, slopes, quintic,
        cells[0] * across[0] + cells[1] * along * axis[0],
        cells[0] * across[1] + cells[1] * along * axis[1],
        cells[0] * across[2] + cells[1] * along * axis[2],
    )  # fmt: skip


@kernel
def wood_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, numbers, axis, stops, mean_color, out, start, stop
):
    """Rings about an axis, with fibers along it."""
    rings, wobble, grain, bound = numbers
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        x, y, z = rings * x, rings * y, rings * z  # one ring is one unit from here on
        width = rings * widest(widths, i)
        along = axis[0] * x + axis[1] * y + axis[2] * z
        across = (x - along * axis[0], y - along * axis[1], z - along * axis[2])
        radius = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
        bend = _drawn_noise(permutation, slopes, quintic, across, along, axis, _BEND_CELLS, width)
        fiber = _drawn_noise(permutation, slopes, quintic, across, along, axis, _FIBER_CELLS, width)
        ring = box_mean(RAMP, _RISE, radius + wobble * bend, width)
        value = (1.0 - grain) * ring + grain * (0.5 + 0.5 * fiber / bound)
        write_color(out, i, value, value, contrast_kept(0.5 * width), stops, mean_color)


@kernel
def granite_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, numbers, stops, mean_color,
    out, start, stop,
):  # fmt: skip
    """A fractal sum, taken to an even distribution."""
    frequency, lacunarity, gain, squares, variance = numbers
    for i in range(start, stop):
        x, y, z = point_coordinates(points, i)
        total, lost = octave_sum(
            permutation, slopes, quintic, octaves, (lacunarity, gain), -1.0,
            frequency * x, frequency * y, frequency * z, frequency * widest(widths, i),
        )  # fmt: skip
        kept = np.sqrt(max(squares - lost, 0.0) / squares)
        value = _evened(total, variance * (squares + lost))
        # What is left of the sum, with the distribution that all of it would have.
        sharp = _evened(total, variance * (squares - lost)) if kept > 0.0 else 0.5
        write_color(out, i, value, sharp, kept, stops, mean_color)


@kernel
def _evened(total, variance):  # type: ignore[no-untyped-def]
    return 1.0 / (1.0 + np.exp(-1.702 * total / np.sqrt(variance)))
