"""Line plots as SVG: some quantities over another, in frames side by side with one scale."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texbake.files import PathLike, replacing
from texbake.pages.histogram import ticks
from texbake.pages.page import number, render

if TYPE_CHECKING:
    from markupsafe import Markup

# Colors that color-blind people can tell apart: Okabe, Ito, "Color universal design", 2008.
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_SHAPES = ("circle", "diamond", "square", "triangle")
_FRAME_WIDTH, _FRAME_HEIGHT = 340, 250
_LEFT, _GAP, _TOP, _BOTTOM, _RIGHT = 62, 34, 58, 50, 16
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
        _drawn(frame, _LEFT + k * (_FRAME_WIDTH + _GAP), top, x_step)
        for k, frame in enumerate(frames)
    ]
    width = _LEFT + len(frames) * (_FRAME_WIDTH + _GAP) - _GAP + _RIGHT
    return render(
        "line_plots.svg",
        title=title,
        y_label=y_label,
        size=(width, _TOP + _FRAME_HEIGHT + _BOTTOM),
        top=_TOP,
        base=_TOP + _FRAME_HEIGHT,
        width=_FRAME_WIDTH,
        middle=_TOP + _FRAME_HEIGHT / 2,
        left=_LEFT,
        marks=[(f"{_height(y, top):.2f}", number(y)) for y in marks],
        frames=drawn,
        legend=[
            {
                "x": _LEFT + k * _LEGEND_STEP,
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
    return _TOP + _FRAME_HEIGHT * (1.0 - y / top)


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
