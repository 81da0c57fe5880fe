"""The bench as one self-contained page, which opens anywhere and without a network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texbake.pages.page import page_html, render
from texbake.study.bench.result import BenchResult, Contest
from texbake.study.bench.table import machine_words
from texbake.study.findings import amount
from texbake.study.page import PAGE_STYLE, crops, setting_row, titled
from texbake.study.plots import Plot
from texbake.study.result import figure_names

_TEMPLATES = Path(__file__).with_name("templates")
_TITLE = "What accuracy costs, program by program"


def bench_page(result: BenchResult, plots: Mapping[str, Plot]) -> str:
    """Return the page as HTML."""
    tasks = dict.fromkeys(contest.task for contest in result.contests)
    body = render(
        "bench.html",
        folder=_TEMPLATES,
        title=_TITLE,
        quick=result.options.quick,
        machine=machine_words(result.machine),
        inputs=list(result.inputs.values()),
        versions=list(result.versions.items()),
        missing=list(result.missing.items()),
        seconds=result.seconds,
        repeats=result.options.repeats,
        warm_up=result.options.seconds,
        tasks=[
            {
                "name": task.name,
                "title": task.title,
                "about": task.about,
                "error": task.error,
                "unit": task.unit,
                "contests": [
                    _contest(contest, plots[contest.name])
                    for contest in result.contests
                    if contest.task is task
                ],
            }
            for task in tasks
        ],
    )
    # The plots are drawn on white.
    return page_html(_TITLE, body, styles=[PAGE_STYLE], dark=False)


def _contest(contest: Contest, plot: Plot) -> dict[str, Any]:
    """Values of the section of a contest."""
    unit = contest.task.unit
    front, memory_front = set(contest.front), set(contest.memory_front)
    return {
        "name": contest.name,
        "case": contest.case,
        "subject": contest.subject,
        "truth": contest.truth,
        "truth_text": contest.truth_text,
        "plot": titled(plot.svg, f"{contest.task.title}: {contest.case}"),
        "names": figure_names(contest.measurements),
        "failures": contest.failures,
        "matches": [
            {
                "program": match.theirs.setting.series,
                "label": match.theirs.setting.label,
                "error": amount(match.theirs.error, unit),
                "median": match.theirs.median,
                "ours": None
                if match.ours is None
                else {
                    "label": match.ours.setting.label,
                    "error": amount(match.ours.error, unit),
                    "median": match.ours.median,
                },
                "times": match.times_as_fast,
            }
            for match in contest.matches()
        ],
        "rows": [
            {
                "program": item.setting.series,
                "on_front": i in front,
                "on_memory_front": i in memory_front,
                **setting_row(item),
            }
            for i, item in enumerate(contest.measurements)
        ],
        "crops": crops(contest.measurements, unit),
    }
