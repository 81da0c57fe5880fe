"""Plots of a contest: error over time and over memory, one curve per program."""

from __future__ import annotations

from texbake.pages.figures import duration, memory
from texbake.study.bench.options import PROGRAM_NAMES
from texbake.study.bench.programs import PROGRAMS
from texbake.study.bench.result import Contest
from texbake.study.plots import COLORS, Dot, Plot, draw_dots, finished_plot, new_figure, plot_style

_COLORS = {PROGRAMS[name].title: color for name, color in zip(PROGRAM_NAMES, COLORS, strict=False)}


# Of axes half as wide as a page.
_MOST_TICKS = 6


def contest_plot(contest: Contest) -> Plot:
    """Plot all settings of all programs: left over seconds, right over memory where it is known.

    The line of a program joins the settings that are on its own front; the dashed line is the front
    of all programs.
    """
    known = any(item.peak_bytes is not None for item in contest.measurements)
    with plot_style():
        figure = new_figure(11.0 if known else 6.4, 4.8)
        frames = figure.subplots(1, 2 if known else 1, squeeze=False)[0]
        for axes, over_memory in zip(frames, (False, True), strict=False):
            _draw(axes, contest, over_memory=over_memory)
        frames[0].set_ylabel(f"{contest.task.error} ({contest.task.unit})")
        for program in contest.programs:
            frames[0].plot([], [], "o-", color=_COLORS[program], label=program, ms=5, lw=0.9)
        frames[0].legend(fontsize=8, frameon=False, loc="best")
        return finished_plot(figure, contest.name)


def _draw(axes, contest: Contest, *, over_memory: bool) -> None:  # type: ignore[no-untyped-def]
    front = contest.memory_front if over_memory else contest.front
    dots: dict[int, Dot] = {}
    for i, item in enumerate(contest.measurements):
        if over_memory and item.peak_bytes is None:
            continue
        x = float(item.peak_bytes or 0) if over_memory else item.median
        ends = (x, x) if over_memory else (min(item.seconds), max(item.seconds))
        dots[i] = Dot(
            x, item.error, *ends, item.setting.label, _COLORS[item.setting.series],
            filled=i in set(front),
        )  # fmt: skip
    lines = [
        (_COLORS[program], [dots[i] for i in contest.curve(program, memory=over_memory)])
        for program in contest.programs
    ]
    draw_dots(
        axes,
        list(dots.values()),
        lines,
        [[dots[i].place for i in front]],
        label_size=7.5,
        x_label="peak memory" if over_memory else "seconds of the whole process (median, range)",
        x_format=_bytes if over_memory else duration,
        most_ticks=_MOST_TICKS,
    )


def _bytes(x: float) -> str:
    return memory(round(x))
