"""The files of the bench: figures, plots, the page and the tables for a README."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texbake.files import PathLike, write_files
from texbake.pages.page import duration, memory, number, page_html, render
from texbake.progress import ProgressSink, Stages
from texbake.study.bench.programs import PROGRAMS
from texbake.study.bench.result import OURS, BenchResult, Contest, Match
from texbake.study.findings import amount
from texbake.study.options import PROGRAM_NAMES
from texbake.study.plots import COLORS, Dot, Plot, draw_dots, finished_plot, new_figure, plot_style
from texbake.study.result import Measurement, figure_names
from texbake.study.write import PAGE_STYLE, TEMPLATES, crop_uri, titled

PAGE, JSON, CSV, TABLE = "bench.html", "bench.json", "bench.csv", "bench.md"


def write_bench(
    result: BenchResult, folder: PathLike, *, progress: ProgressSink | None = None
) -> list[Path]:
    """Write everything that the bench measured."""
    stages = Stages(progress)
    plots = {}
    with stages.stage("draw plots", total=len(result.contests), unit="plots") as advance:
        for contest in result.contests:
            plots[contest.name] = contest_plot(contest)
            advance(1)
    with stages.stage("write"):
        files = {
            PAGE: bench_page(result, plots).encode("utf-8"),
            JSON: (json.dumps(result.to_json(), indent=2) + "\n").encode("utf-8"),
            CSV: result.to_csv().encode("utf-8"),
            TABLE: markdown(result).encode("utf-8"),
            **{f"{name}.png": plot.png for name, plot in plots.items()},
        }
        return write_files(folder, files)


_HEAD = (
    "| case | program | setting | error | time | memory | texbake as accurate | error | time "
    "| memory | times as fast |"
)


def markdown(result: BenchResult) -> str:
    """Return one table per task: each setting of a program beside texbake's fastest as accurate."""
    lines = [machine_words(result.machine), "", version_words(result), ""]
    for task in dict.fromkeys(contest.task.name for contest in result.contests):
        contests = [contest for contest in result.contests if contest.task.name == task]
        lines += [f"**{contests[0].task.title}** (error: {contests[0].task.error})", ""]
        rows = [row for contest in contests for row in _rows(contest)]
        lines += [_HEAD, "|" + "---|" * (_HEAD.count("|") - 1), *rows, ""]
    return "\n".join(lines).rstrip() + "\n"


def machine_words(machine: dict[str, Any]) -> str:
    """Return the machine in a sentence."""
    words = [machine.get("model", machine["processor"]), f"{machine['processors']} processors"]
    if "memory_bytes" in machine:
        words.append(memory(machine["memory_bytes"]))
    return f"Measured on {', '.join(words)}, {machine['system']}, Python {machine['python']}."


def version_words(result: BenchResult) -> str:
    """Return the versions of the programs, and those that are missing, in sentences."""
    have = ", ".join(f"{title} {version}" for title, version in result.versions.items())
    words = f"Programs: {have}."
    if result.missing:
        words += f" Not installed: {', '.join(result.missing)}."
    return words


def _rows(contest: Contest) -> list[str]:
    unit = contest.task.unit
    matches = contest.matches()
    if not matches:  # texbake alone
        return [
            f"| {contest.case} | {OURS} | {item.setting.label} | {_figures(item, unit)} | | | | | |"
            for item in (contest.measurements[i] for i in contest.curve(OURS))
        ]
    return [_row(contest.case, match, unit) for match in matches]


def _row(case: str, match: Match, unit: str) -> str:
    theirs = match.theirs
    start = (
        f"| {case} | {theirs.setting.series} | {theirs.setting.label} | {_figures(theirs, unit)} "
    )
    if match.ours is None or match.times_as_fast is None:
        return f"{start}| none | | | | |"
    ours = match.ours
    return (
        f"{start}| {ours.setting.label} | {_figures(ours, unit)} | {number(match.times_as_fast)} |"
    )


def _figures(item: Measurement, unit: str) -> str:
    low, high = duration(min(item.seconds)), duration(max(item.seconds))
    time = duration(item.median) if low == high else f"{duration(item.median)} ({low} to {high})"
    return f"{amount(item.error, unit)} | {time} | {memory(item.peak_bytes)}"


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


_TITLE = "What accuracy costs, program by program"


def bench_page(result: BenchResult, plots: Mapping[str, Plot]) -> str:
    """Return the page as HTML."""
    body = render(
        "bench.html",
        folder=TEMPLATES,
        title=_TITLE,
        result=result,
        machine=machine_words(result.machine),
        tasks=list(dict.fromkeys(contest.task for contest in result.contests)),
        plots={
            contest.name: titled(plots[contest.name].svg, f"{contest.task.title}: {contest.case}")
            for contest in result.contests
        },
        amount=amount,
        figure_names=figure_names,
        uri_of=crop_uri,
    )
    # The plots are drawn on white.
    return page_html(_TITLE, body, styles=[PAGE_STYLE], dark=False)
