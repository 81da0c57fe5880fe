"""The files of the bench: figures, plots, the page and the tables for a README."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texbake.files import PathLike, write_files
from texbake.pages.page import duration, memory, number, page_html, render
from texbake.progress import Progress, Stages
from texbake.study.bench.map_tasks import MISSED
from texbake.study.bench.programs import PROGRAMS
from texbake.study.bench.result import OURS, BenchResult, Contest
from texbake.study.options import PROGRAM_NAMES
from texbake.study.plots import COLORS, Dot, Plot, draw_dots, finished_plot, new_figure, plot_style
from texbake.study.result import Measurement, amount, figure_names
from texbake.study.study import PAGE_STYLE, TEMPLATES, crop_uri, titled

PAGE, JSON, TABLE = "bench.html", "bench.json", "bench.md"


def write_bench(result: BenchResult, folder: PathLike, *, progress: Progress = None) -> list[Path]:
    """Write everything that the bench measured."""
    stages = Stages(progress)
    plots = {}
    with stages.stage("draw plots", total=len(result.contests), unit="plots") as advance:
        for contest in result.contests:
            plots[contest.name] = contest_plot(contest, program_colors(result))
            advance(1)
    with stages.stage("write"):
        files = {
            PAGE: bench_page(result, plots).encode("utf-8"),
            JSON: (json.dumps(result.to_json(), indent=2) + "\n").encode("utf-8"),
            TABLE: markdown(result).encode("utf-8"),
            **{f"{name}.png": plot.png for name, plot in plots.items()},
        }
        return write_files(folder, files)


_SUMMARY = "| case | task | texbake | {rival} | times as fast | error: texbake / other | memory |"


def markdown(result: BenchResult) -> str:
    """Return what was measured on, and a summary, for a README."""
    return "\n".join([f"{machine_words(result)} {version_words(result)}", "", *summary(result), ""])


def summary(result: BenchResult) -> list[str]:
    """Return a table for a README: texbake beside one other program, a row for most tasks."""
    rival = next((title for title in result.versions if title != OURS), OURS)
    head = _SUMMARY.format(rival=f"{rival} {result.versions.get(rival, '')}".strip())
    rows = []
    for contest in result.contests:
        if OURS not in contest.programs:
            continue
        theirs = [item for item in contest.measurements if item.setting.series == rival]
        if contest.task.name != "bake-normals":
            theirs = theirs[len(theirs) // 2 :][:1]
        rows += [_summary_row(contest, item) for item in theirs]
    return [head, "|" + "---|" * (head.count("|") - 1), *rows]


def _summary_row(contest: Contest, theirs: Measurement) -> str:
    match = contest.match(theirs)
    ours = match.ours or contest.measurements[contest.curve(OURS)[-1]]
    label = theirs.setting.label
    if ours.setting.label != label:
        label += f" ({OURS}: {ours.setting.label})"
    times = "less accurate" if match.times_as_fast is None else number(match.times_as_fast)
    unit = contest.task.unit
    return (
        f"| {contest.case} | {contest.task.title.lower()}, {label} | {duration(ours.median)} "
        f"| {duration(theirs.median)} | {times} "
        f"| {amount(ours.error, unit)} / {amount(theirs.error, unit)} "
        f"| {memory(ours.peak_bytes)} / {memory(theirs.peak_bytes)} |"
    )


def machine_words(result: BenchResult) -> str:
    """Return the date and the machine in a sentence, and which programs ran elsewhere."""
    groups: dict[str, list[str]] = {}
    for title, machine in result.machines.items():
        groups.setdefault(_machine(machine), []).append(title)
    first, *others = groups
    sentences = [f"Measured on {result.date}, on {first}."]
    sentences += [
        f"{' and '.join(groups[machine])} ran on {machine}: compare these times with care."
        for machine in others
    ]
    return " ".join(sentences)


def _machine(machine: dict[str, Any]) -> str:
    words = [machine.get("model", machine["processor"]), f"{machine['processors']} processors"]
    if "memory_bytes" in machine:
        words.append(memory(machine["memory_bytes"]))
    return ", ".join([*words, machine["system"]])


def version_words(result: BenchResult) -> str:
    """Return the versions of the programs, and those that are missing, in sentences."""
    have = ", ".join(f"{title} {version}" for title, version in result.versions.items())
    words = f"Programs: {have}."
    if result.missing:
        words += f" Not installed: {', '.join(result.missing)}."
    return words


def program_colors(result: BenchResult) -> dict[str, str]:
    """Return a color for each program, the same on all plots."""
    titles = dict.fromkeys([*[PROGRAMS[name].title for name in PROGRAM_NAMES], *result.versions])
    return {title: COLORS[i % len(COLORS)] for i, title in enumerate(titles)}


# Of axes half as wide as a page.
_MOST_TICKS = 6


def contest_plot(contest: Contest, colors: Mapping[str, str]) -> Plot:
    """Plot all settings: left over seconds, right over memory; fronts are lines."""
    known = any(item.peak_bytes is not None for item in contest.measurements)
    with plot_style():
        figure = new_figure(11.0 if known else 6.4, 4.8)
        frames = figure.subplots(1, 2 if known else 1, squeeze=False)[0]
        for axes, over_memory in zip(frames, (False, True), strict=False):
            _draw(axes, contest, colors, over_memory=over_memory)
        frames[0].set_ylabel(f"{contest.task.error} ({contest.task.unit})")
        for program in contest.programs:
            frames[0].plot([], [], "o-", color=colors[program], label=program, ms=5, lw=0.9)
        frames[0].legend(fontsize=8, frameon=False, loc="best")
        return finished_plot(figure, contest.name)


def _draw(  # type: ignore[no-untyped-def]
    axes, contest: Contest, colors: Mapping[str, str], *, over_memory: bool
) -> None:
    front = contest.memory_front if over_memory else contest.front
    dots: dict[int, Dot] = {}
    for i, item in enumerate(contest.measurements):
        if over_memory and item.peak_bytes is None:
            continue
        x = float(item.peak_bytes or 0) if over_memory else item.median
        ends = (x, x) if over_memory else (min(item.seconds), max(item.seconds))
        dots[i] = Dot(
            x, item.error, *ends, item.setting.label, colors[item.setting.series],
            filled=i in set(front),
        )  # fmt: skip
    lines = [
        (colors[program], [dots[i] for i in contest.curve(program, memory=over_memory)])
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
        machine=machine_words(result),
        missed=MISSED,
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
