"""Patterns along one coordinate that repeat, averaged over an interval by their integral.

Each has the period 1 and values from 0 to 1; `width` is the share of a period, above 0 and below 1:

- `HARD`: 1 over the first `width` of the period, then 0.
- `SINE`: half a wave above 1/2 over the first `width`, half a wave below it over the rest; a sine
  where `width` is 1/2.
- `RAMP`: straight up to 1 over the first `width`, straight down to 0 over the rest.

Their mean over an interval is the difference of their integral at its ends divided by its length,
which is exact: edges finer than a pixel become the gray that they are.

`box_mean` can be called from the kernels of other modules.

Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11 (the filtered pulse train).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

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
        return _value(pattern, width, phase - np.floor(phase))
    start = phase - 0.5 * span
    start -= np.floor(start)
    end = start + span
    periods = np.floor(end)
    area = periods * _integral(pattern, width, 1.0) + _integral(pattern, width, end - periods)
    return min(max((area - _integral(pattern, width, start)) / span, 0.0), 1.0)


@kernel
def _value(pattern, width, t):  # type: ignore[no-untyped-def]
    if pattern == HARD:
        return 1.0 if t < width else 0.0
    if t < width:
        t /= width
        return 0.5 + 0.5 * np.sin(np.pi * t) if pattern == SINE else t
    t = (1.0 - t) / (1.0 - width)
    return 0.5 - 0.5 * np.sin(np.pi * t) if pattern == SINE else t


@kernel
def _integral(pattern, width, t):  # type: ignore[no-untyped-def]
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
