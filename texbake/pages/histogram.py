"""How often which distance occurs, drawn as SVG that follows the colors of its page."""

from __future__ import annotations

import math
from html import escape

import numpy as np
import numpy.typing as npt

from texbake.pages.words import number

_WIDTH, _HEIGHT = 640, 240  # of the whole picture
_LEFT, _RIGHT, _TOP, _BOTTOM = 12, 12, 14, 44
_BINS = 64
# Bars reach from this to the rest of 100 percent; what lies beyond is counted in words.
_TAIL_PERCENT = 0.1
_MOST_TICKS = 7


def histogram_svg(values: npt.NDArray[np.floating], *, title: str, unit: str) -> str:
    """Draw a histogram.

    Parameters
    ----------
    values : (N,) float
        Not finite ones are left out.
    title
        What it is called for those who do not see it.
    unit
        What stands beside the axis.

    Returns
    -------
    str
        An `svg` element of the class `histogram`; "" without any value.
    """
    values = np.asarray(values[np.isfinite(values)], np.float64)
    if not len(values):
        return ""
    low, median, high = np.percentile(values, (_TAIL_PERCENT, 50.0, 100.0 - _TAIL_PERCENT)).tolist()
    # Bars narrower than a step of float64 cannot be told apart.
    if not high - low > _BINS * np.spacing(max(abs(low), abs(high))):
        room = abs(low) or 1.0
        low, high = low - room, high + room
    counts, _ = np.histogram(values, bins=_BINS, range=(low, high))
    width, height = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    bar, top = width / _BINS, max(int(counts.max()), 1)
    edge = (high - low) / _BINS
    bars = "".join(
        f'<rect x="{_LEFT + k * bar:.2f}" y="{_TOP + height * (1 - count / top):.2f}" '
        f'width="{bar - 1:.2f}" height="{height * count / top:.2f}"><title>'
        f"{number(low + k * edge)} to {number(low + (k + 1) * edge)}: "
        f"{100 * count / len(values):.2f} %</title></rect>"
        for k, count in enumerate(counts.tolist())
        if count
    )
    return (
        f'<svg class="histogram" role="img" aria-label="{escape(title)}" '
        f'viewBox="0 0 {_WIDTH} {_HEIGHT}"><g class="bars">{bars}</g>'
        f"{_marks(low, median, high, width, height)}"
        f'<text class="unit" x="{_WIDTH / 2}" y="{_HEIGHT - 6}">{escape(unit)}</text></svg>\n'
    )


def _marks(low: float, median: float, high: float, width: int, height: int) -> str:
    """Axis with its ticks, and the median."""
    base = _TOP + height
    parts = [f'<line class="axis" x1="{_LEFT}" x2="{_LEFT + width}" y1="{base}" y2="{base}"/>']
    for tick in ticks(low, high):
        x = _LEFT + width * (tick - low) / (high - low)
        parts.append(
            f'<line class="axis" x1="{x:.2f}" x2="{x:.2f}" y1="{base}" y2="{base + 5}"/>'
            f'<text x="{min(max(x, 24), _WIDTH - 24):.2f}" y="{base + 19}">{number(tick)}</text>'
        )
    x = _LEFT + width * (median - low) / (high - low)
    parts.append(
        f'<line class="median" x1="{x:.2f}" x2="{x:.2f}" y1="{_TOP - 2}" y2="{base}"/>'
        f'<text class="median" x="{min(max(x, 60), _WIDTH - 60):.2f}" y="{_TOP - 4}">'
        f"median {number(median)}</text>"
    )
    return "".join(parts)


def ticks(low: float, high: float) -> list[float]:
    """Round numbers from `low` to `high`, at most seven.

    Examples
    --------
    >>> ticks(-0.03, 0.021)
    [-0.03, -0.02, -0.01, 0.0, 0.01, 0.02]
    """
    power = 10.0 ** math.floor(math.log10((high - low) / _MOST_TICKS))
    for step in (power, 2 * power, 5 * power, 10 * power):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < _MOST_TICKS:
            break
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]
