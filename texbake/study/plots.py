"""Plots of error over time on logarithmic scales, with Pareto fronts and labeled points.

Based on: Christensen, Marks, Shieber, "An empirical study of algorithms for point-feature label
placement", ACM TOG 14(3), 1995, for the places of labels and their order of preference. Labels of
crowded points are placed first.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import require_library
from texbake.mesh.mesh import FloatArray
from texbake.pages.page import duration, number
from texbake.records import dataclass
from texbake.study.result import KnobResult

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colors that color-blind people can tell apart: Okabe, Ito, "Color universal design", 2008.
COLORS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#5B4FA0", "#7A7A7A",
)  # fmt: skip
_FRONT, _INK, _GRID = "#222222", "#333333", "#e3e3e3"
# Where an error of 0 is drawn, as a share of the smallest error above 0.
_ZERO = 0.2
_DPI = 150
# Mantissas of ticks, from the most to the fewest.
_STEPS = (
    tuple(tenths / 10.0 for tenths in range(10, 100)),
    (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9),
    (1, 1.5, 2, 3, 5, 7),
    (1, 2, 5),
    (1, 3),
    (1,),
)
_MOST_TICKS = 8
# Heights in inches of frames with many and with few points.
_CROWDED, _SPARSE, _MANY = 6.5, 3.6, 12
_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Helvetica", "Arial"],
    "font.size": 9.0,
    "axes.edgecolor": "#999999",
    "axes.labelcolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "texbake",
}


@dataclass(frozen=True, eq=False)
class Plot:
    """A plot as `svg`, ready to be put into a page, and as `png`."""

    svg: str
    png: bytes


def check_matplotlib(extra: str = "study") -> None:
    """Raise `DependencyError` if plots cannot be drawn; `extra` is what installs matplotlib."""
    require_library("matplotlib", "plots", f'"texbake[{extra}]"')


def knob_plot(result: KnobResult) -> Plot:
    """Plot all settings of a knob."""
    with plot_style():
        figure = new_figure(6.4, 4.4)
        axes = figure.add_subplot()
        names = dict.fromkeys(item.setting.series for item in result.measurements)
        colors = {(result.knob.name, name): COLORS[i % len(COLORS)] for i, name in enumerate(names)}
        _draw(axes, [result], colors, label_size=8.0)
        unit = f" ({result.knob.unit})" if result.knob.unit else ""
        axes.set_ylabel(f"{result.knob.error}{unit}")
        return finished_plot(figure, result.knob.name)


def all_plot(results: Sequence[KnobResult]) -> Plot:
    """Plot all settings of all knobs, with errors of one kind in one frame."""
    kinds = list(dict.fromkeys(result.knob.kind for result in results))
    kinds.sort(key=lambda kind: -sum(len(r.measurements) for r in results if r.knob.kind == kind))
    with plot_style():
        counts = [sum(len(r.measurements) for r in results if r.knob.kind == k) for k in kinds]
        heights = [_CROWDED if count > _MANY else _SPARSE for count in counts]
        figure = new_figure(9.0, sum(heights))
        frames = figure.subplots(len(kinds), 1, squeeze=False, height_ratios=heights)[:, 0]
        for axes, kind in zip(frames, kinds, strict=True):
            shown = [result for result in results if result.knob.kind == kind]
            colors = {
                (r.knob.name, series): COLORS[i % len(COLORS)]
                for i, r in enumerate(shown)
                for series in {item.setting.series for item in r.measurements}
            }
            _draw(axes, shown, colors, label_size=7.0)
            units = ", ".join(dict.fromkeys(r.knob.unit for r in shown if r.knob.unit))
            axes.set_ylabel(f"error ({units})" if units else "error")
            title = shown[0].knob.title if len(shown) == 1 else f"{len(shown)} knobs: {kind}"
            axes.set_title(title, fontsize=9, loc="left", fontweight="bold")
            for i, result in enumerate(shown):
                axes.plot([], [], "o", color=COLORS[i % len(COLORS)], label=result.knob.title, ms=5)
            if len(shown) > 1:
                axes.legend(fontsize=7.5, frameon=False, loc="best")
        return finished_plot(figure, "all")


@dataclass(frozen=True)
class Dot:
    """A point of a plot."""

    # x, y: y may be 0, which is drawn below all others.
    x: float
    y: float
    # least, most: ends of a bar along x.
    least: float
    most: float
    label: str
    color: str
    filled: bool = False  # whether it is on a front
    ringed: bool = False  # whether a ring marks it

    @property
    def place(self) -> tuple[float, float]:
        """Where it lies."""
        return self.x, self.y


def draw_dots(
    axes: Axes,
    dots: Sequence[Dot],
    lines: Sequence[tuple[str, Sequence[Dot]]],
    fronts: Sequence[Sequence[tuple[float, float]]],
    *,
    label_size: float,
    x_label: str,
    x_format: Callable[[float], str],
    most_ticks: int = _MOST_TICKS,
) -> None:
    """Draw labeled dots on logarithmic scales, lines of a color through some, and dashed fronts."""
    floor = _floor([dot.y for dot in dots])
    for dot in dots:
        y = max(dot.y, floor)
        axes.plot([dot.least, dot.most], [y, y], color=dot.color, lw=1.2, alpha=0.6)
        face = dot.color if dot.filled else "white"
        axes.plot(dot.x, y, "o", ms=5.5, mec=dot.color, mfc=face, mew=1.2, zorder=3)
        if dot.ringed:
            axes.plot(dot.x, y, "o", ms=11, mec=dot.color, mfc="none", mew=1.0, zorder=2)
    for color, through in lines:
        points = [(dot.x, max(dot.y, floor)) for dot in through]
        if len(points) > 1:
            axes.plot(*zip(*points, strict=True), color=color, lw=0.9, alpha=0.45, zorder=1)
    for front in fronts:
        _draw_front(axes, front, floor)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(x_label)
    axes.grid(True, which="major", color=_GRID, lw=0.6, zorder=0)
    axes.set_axisbelow(True)
    texts = [(dot.x, max(dot.y, floor), dot.label, dot.color, label_size) for dot in dots]
    _widen(axes, texts, floor, most_ticks)
    axes.xaxis.set_major_formatter(lambda x, _: x_format(x))
    axes.yaxis.set_major_formatter(lambda y, _: "0" if y <= floor * 1.001 else number(y))
    axes.minorticks_off()
    axes._study_labels = texts  # type: ignore[attr-defined]


def _draw(
    axes: Axes, results: list[KnobResult], colors: dict[tuple[str, str], str], *, label_size: float
) -> None:
    """Draw the settings of knobs with the range of their times, and lines along series."""
    dots, lines = [], []
    for result in results:
        fronts, knees = set(result.front), set(result.knees)
        series: dict[str, list[Dot]] = {}
        for i, item in enumerate(result.measurements):
            name = item.setting.series
            dot = Dot(
                item.median, item.error, min(item.seconds), max(item.seconds), item.setting.label,
                colors[result.knob.name, name], filled=i in fronts, ringed=i in knees,
            )  # fmt: skip
            dots.append(dot)
            series.setdefault(name, []).append(dot)
        lines += [(through[0].color, through) for name, through in series.items() if name]
    draw_dots(
        axes,
        dots,
        lines,
        [[r.measurements[i].point for i in front] for r in results for front in r.fronts],
        label_size=label_size,
        x_label="seconds (median; bars from least to greatest)",
        x_format=duration,
    )


def _draw_front(axes: Axes, points: Sequence[tuple[float, float]], floor: float) -> None:
    """Draw a front as steps: the least error that can be had in each time."""
    if len(points) > 1:
        seconds, errors = zip(*points, strict=True)
        axes.step(
            seconds, np.maximum(errors, floor), where="post", color=_FRONT, lw=1.0, ls=(0, (4, 2))
        )


def _floor(errors: list[float]) -> float:
    """Return the height at which an error of 0 is drawn; 0 if there is no such error."""
    above = [error for error in errors if error > 0.0]
    if not above:
        return 1.0
    return _ZERO * min(above) if len(above) < len(errors) else 0.0


def _widen(axes: Axes, texts: list[Any], floor: float, most_ticks: int) -> None:
    """Make room around the points for their labels, and set ticks between powers of ten."""
    for values, set_limits in (
        ([text[0] for text in texts], axes.set_xlim),
        ([text[1] for text in texts], axes.set_ylim),
    ):
        low, high = pm.log10(min(values)), pm.log10(max(values))
        room = 0.12 * max(high - low, 0.3) + 0.06
        set_limits(pm.power(10.0, low - room), pm.power(10.0, high + room))
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        ticks = _ticks(*limits, most_ticks)
        if floor and axis is axes.yaxis:
            ticks = [floor, *(tick for tick in ticks if tick > 2.0 * floor)]
        axis.set_ticks(ticks)


def _ticks(low: float, high: float, most: int) -> list[float]:
    """Return round numbers within limits, as many as fit."""
    powers = range(int(np.floor(pm.log10(low))) - 1, int(np.ceil(pm.log10(high))) + 1)
    for steps in _STEPS:
        ticks = [step * pm.power(10.0, power) for power in powers for step in steps]
        inside = [tick for tick in ticks if low <= tick <= high]
        if len(inside) <= most:
            return inside
    return inside[:: -(-len(inside) // most)]


def _label_all(axes: Axes, figure: Figure) -> None:
    from matplotlib.text import Annotation

    texts = axes._study_labels  # type: ignore[attr-defined]
    points = axes.transData.transform([(x, y) for x, y, *_ in texts])
    annotations = [
        Annotation(text, (x, y), xytext=(0, 0), textcoords="offset points", color=color,
                   fontsize=size, annotation_clip=False)
        for x, y, text, color, size in texts
    ]  # fmt: skip
    for item in annotations:
        axes.add_artist(item)
    extents = [item.get_window_extent() for item in annotations]
    sizes = np.array([(box.width, box.height) for box in extents])
    corners = place_labels(points, sizes, axes.get_window_extent().extents)
    for item, corner, point, size in zip(annotations, corners, points, sizes, strict=True):
        item.set_position(tuple((corner - point) * (72.0 / figure.dpi)))
        nearest = np.clip(point, corner, corner + size)
        if pm.norm(nearest - point) > 1.5 * size[1]:
            ends = axes.transData.inverted().transform([point, nearest])
            axes.plot(*ends.T, color=item.get_color(), lw=0.5, alpha=0.6, zorder=1)


@contextmanager
def plot_style() -> Iterator[None]:
    """Draw in the style of the study within this block."""
    check_matplotlib()
    from matplotlib import rc_context

    with rc_context(cast("Any", _STYLE)):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=_DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def finished_plot(figure: Figure, name: str) -> Plot:
    """Place the labels of a figure and return it; identifiers in its SVG begin with a name."""
    # Labels are placed for this layout, so it must not change any more.
    figure.canvas.draw()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        _label_all(axes, figure)
    png, svg = io.BytesIO(), io.StringIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return Plot(_inline(svg.getvalue(), name), png.getvalue())


def _inline(svg: str, name: str) -> str:
    """Return the SVG for the inside of a page: no header, no addresses, unique identifiers."""
    svg = svg[svg.index("<svg") :]
    for pattern, words in (
        (r"<metadata>.*?</metadata>", ""),
        (r'\s+xmlns(:\w+)?="[^"]*"', ""),
        (r'\bid="', f'id="{name}-'),
        (r"url\(#", f"url(#{name}-"),
        (r'href="#', f'href="#{name}-'),
    ):
        svg = re.sub(pattern, words, svg, flags=re.DOTALL)
    # The page sets its size.
    head, rest = svg.split(">", 1)
    return re.sub(r'\s(width|height)="[^"]*"', "", head) + ">" + rest


# Directions in turns, the best first, and distances in heights of a label.
_TURNS = (1 / 8, 7 / 8, 3 / 8, 5 / 8, 0.0, 1 / 2, 1 / 4, 3 / 4, 1 / 16, 15 / 16, 7 / 16, 9 / 16)
_DISTANCES = (0.35, 0.9, 1.6, 2.6, 4.0)
_MARK = 8.0  # radius of the mark of a point, in pixels
# Costs of hiding a point, leaving the frame and lying farther away, in areas of a label.
_POINT, _OUTSIDE, _FAR, _ORDER = 0.6, 8.0, 0.05, 0.004


def place_labels(points: FloatArray, sizes: FloatArray, frame: Sequence[float]) -> FloatArray:
    """(n, 2) lower left corners of labels of sizes (n, 2) at points (n, 2), pixels, y up."""
    n = len(points)
    away = pm.norm(points[:, None] - points[None, :], axis=-1)
    crowds = (away < 60.0).sum(axis=1)
    corners = np.zeros((n, 2))
    placed: list[int] = []
    for i in sorted(range(n), key=lambda i: (-crowds[i], i)):
        best, least = corners[i], math.inf
        for corner, bias in _places(points[i], sizes[i]):
            cost = bias + _cost(i, corner, points, sizes, corners, placed, frame)
            if cost < least:
                best, least = corner, cost
        corners[i] = best
        placed.append(i)
    return corners


def _places(point: FloatArray, size: FloatArray) -> list[tuple[FloatArray, float]]:
    places = []
    for far, distance in enumerate(_DISTANCES):
        for order, turn in enumerate(_TURNS):
            angle = 2.0 * math.pi * turn
            out = np.array([pm.cos(angle), pm.sin(angle)])
            # The side of the label that faces the point lies at this distance.
            center = (
                point + out * (_MARK + distance * size[1]) + 0.5 * size * np.sign(np.round(out, 6))
            )
            places.append((center - 0.5 * size, _FAR * far + _ORDER * order))
    return places


def _cost(
    i: int,
    corner: FloatArray,
    points: FloatArray,
    sizes: FloatArray,
    corners: FloatArray,
    placed: list[int],
    frame: Sequence[float],
) -> float:
    low, high = corner, corner + sizes[i]
    cost = 0.0
    if placed:
        others = np.array(placed)
        shared = np.minimum(high, corners[others] + sizes[others]) - np.maximum(
            low, corners[others]
        )
        cost += float(np.clip(shared, 0.0, None).prod(axis=1).sum() / sizes[i].prod())
    hidden = ((points > low - 2.0) & (points < high + 2.0)).all(axis=1)
    cost += _POINT * float(hidden.sum())
    left, bottom, right, top = frame
    if low[0] < left or low[1] < bottom or high[0] > right or high[1] > top:
        cost += _OUTSIDE
    return cost
