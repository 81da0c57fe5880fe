"""Plots as SVG: histograms in the colors of their page, and lines in frames side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.files import PathLike, replacing
from texbake.pages.page import number, render
from texbake.records import dataclass

if TYPE_CHECKING:
    from markupsafe import Markup

_WIDTH, _HEIGHT = 640, 240  # of the whole picture
_LEFT, _RIGHT, _TOP, _BOTTOM = 12, 12, 14, 44
_BINS = 64
# Percentiles at which the bars begin and end; the caption gives the greatest value.
_TAIL_PERCENT = 0.1
_MAX_TICKS = 7


def histogram_svg(values: npt.NDArray[np.floating], *, title: str, unit: str) -> Markup | str:
    """Draw a histogram of values (N,)."""
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

    >>> ticks(-0.03, 0.021)
    [-0.03, -0.02, -0.01, 0.0, 0.01, 0.02]
    """
    power = 10 ** math.floor(pm.log10((high - low) / _MAX_TICKS))
    for step in (power, 2 * power, 5 * power, 10 * power):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < _MAX_TICKS:
            break
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


# Colors that color-blind people can tell apart: Okabe, Ito, "Color universal design", 2008.
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_SHAPES = ("circle", "diamond", "square", "triangle")
_FRAME_WIDTH, _FRAME_HEIGHT = 340, 250
_FRAME_LEFT, _FRAME_GAP, _FRAME_TOP, _FRAME_BOTTOM, _FRAME_RIGHT = 62, 34, 58, 50, 16
_LEGEND_STEP = 165


@dataclass(frozen=True)
class LineFrame:
    """One frame: `lines` by name, each of points (x, y), over the axis `x_label`."""

    title: str
    x_label: str
    lines: Mapping[str, Sequence[tuple[float, float]]]


def line_plots_svg(
    frames: Sequence[LineFrame], *, title: str, y_label: str, x_step: float
) -> Markup:
    """Draw frames side by side, with one legend and one vertical scale, which begins at 0."""
    top = max(y for frame in frames for line in frame.lines.values() for _, y in line)
    marks = ticks(0.0, top or 1.0)
    step = marks[1] - marks[0]
    top = step * math.ceil((top or 1.0) / step)
    marks = [step * k for k in range(round(top / step) + 1)]
    names = list(frames[0].lines)
    drawn = [
        _drawn(frame, _FRAME_LEFT + k * (_FRAME_WIDTH + _FRAME_GAP), top, x_step)
        for k, frame in enumerate(frames)
    ]
    width = _FRAME_LEFT + len(frames) * (_FRAME_WIDTH + _FRAME_GAP) - _FRAME_GAP + _FRAME_RIGHT
    return render(
        "line_plots.svg",
        title=title,
        y_label=y_label,
        size=(width, _FRAME_TOP + _FRAME_HEIGHT + _FRAME_BOTTOM),
        top=_FRAME_TOP,
        base=_FRAME_TOP + _FRAME_HEIGHT,
        width=_FRAME_WIDTH,
        middle=_FRAME_TOP + _FRAME_HEIGHT / 2,
        left=_FRAME_LEFT,
        marks=[(f"{_height(y, top):.2f}", number(y)) for y in marks],
        frames=drawn,
        legend=[
            {
                "x": _FRAME_LEFT + k * _LEGEND_STEP,
                "name": name,
                "color": _COLORS[k],
                "shape": _SHAPES[k],
            }
            for k, name in enumerate(names)
        ],
    )


def write_svg(svg: Markup, path: PathLike) -> None:
    """Write an `svg` element as a file of its own, in dark ink on white."""
    head = '<svg xmlns="http://www.w3.org/2000/svg" style="background:#fff;color:#333" '
    with replacing(path) as temporary:
        temporary.write_text(str(svg).replace("<svg ", head, 1) + "\n", encoding="utf-8")


def _height(y: float, top: float) -> float:
    return _FRAME_TOP + _FRAME_HEIGHT * (1.0 - y / top)


def _drawn(frame: LineFrame, left: float, top: float, x_step: float) -> dict[str, object]:
    """Return what the template draws of a frame that begins at `left`."""
    xs = [x for line in frame.lines.values() for x, _ in line]
    low, high = min(xs), max(xs)

    def place(x: float) -> float:
        return left + _FRAME_WIDTH * (x - low) / ((high - low) or 1.0)

    first, last = math.ceil(low / x_step), math.floor(high / x_step)
    return {
        "title": frame.title,
        "x_label": frame.x_label,
        "left": left,
        "middle": left + _FRAME_WIDTH / 2,
        "ticks": [(f"{place(k * x_step):.2f}", number(k * x_step)) for k in range(first, last + 1)],
        "lines": [
            {
                "color": _COLORS[k],
                "shape": _SHAPES[k],
                "points": [
                    (
                        f"{place(x):.2f}",
                        f"{_height(y, top):.2f}",
                        f"{name}, {number(x)}: {number(y)}",
                    )
                    for x, y in line
                ],
            }
            for k, (name, line) in enumerate(frame.lines.items())
        ],
    }
