"""Histograms as SVG, in the colors of their page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.pages.page import number, render

if TYPE_CHECKING:
    from markupsafe import Markup

_WIDTH, _HEIGHT = 640, 240  # of the whole picture
_LEFT, _RIGHT, _TOP, _BOTTOM = 12, 12, 14, 44
_BINS = 64
# Percentiles at which the bars begin and end; the caption gives the greatest value.
_TAIL_PERCENT = 0.1
_MAX_TICKS = 7


def histogram_svg(values: npt.NDArray[np.floating], *, title: str, unit: str) -> Markup | str:
    """Draw a histogram.

    `values` (N,) float.
    """
    values = np.asarray(values[np.isfinite(values)], np.float64)
    if not len(values):
        return ""
    low, median, high = np.percentile(values, (_TAIL_PERCENT, 50.0, 100.0 - _TAIL_PERCENT)).tolist()
    # Bars narrower than a step of float64 cannot be distinguished.
    if not high - low > _BINS * np.spacing(max(abs(low), abs(high))):
        room = abs(low) or 1.0
        low, high = low - room, high + room
    counts, _ = np.histogram(values, bins=_BINS, range=(low, high))
    width, height = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    bar, top = width / _BINS, max(int(counts.max()), 1)
    edge = (high - low) / _BINS

    def place(value: float) -> float:
        return float(_LEFT + width * (value - low) / (high - low))

    bars = [
        {
            "x": f"{_LEFT + k * bar:.2f}",
            "y": f"{_TOP + height * (1 - count / top):.2f}",
            "width": f"{bar - 1:.2f}",
            "height": f"{height * count / top:.2f}",
            "label": f"{number(low + k * edge)} to {number(low + (k + 1) * edge)}: "
            f"{100 * count / len(values):.2f} %",
        }
        for k, count in enumerate(counts.tolist())
        if count
    ]
    marks = [
        {
            "x": f"{place(tick):.2f}",
            "text_x": f"{min(max(place(tick), 24), _WIDTH - 24):.2f}",
            "label": number(tick),
        }
        for tick in ticks(low, high)
    ]
    return render(
        "histogram.svg",
        title=title,
        unit=unit,
        size=(_WIDTH, _HEIGHT),
        left=_LEFT,
        right=_LEFT + width,
        top=_TOP,
        base=_TOP + height,
        bars=bars,
        ticks=marks,
        median={
            "x": f"{place(median):.2f}",
            "text_x": f"{min(max(place(median), 60), _WIDTH - 60):.2f}",
            "label": number(median),
        },
    )


def ticks(low: float, high: float) -> list[float]:
    """Return at most seven round numbers from `low` to `high`.

    Examples
    --------
    >>> ticks(-0.03, 0.021)
    [-0.03, -0.02, -0.01, 0.0, 0.01, 0.02]
    """
    power = 10 ** math.floor(pm.log10((high - low) / _MAX_TICKS))
    for step in (power, 2 * power, 5 * power, 10 * power):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < _MAX_TICKS:
            break
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]
