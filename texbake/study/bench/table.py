"""The bench as Markdown: what a README shows."""

from __future__ import annotations

from typing import Any

from texbake.pages.figures import duration, memory, number
from texbake.study.bench.result import OURS, BenchResult, Contest, Match
from texbake.study.findings import amount
from texbake.study.result import Measurement

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
