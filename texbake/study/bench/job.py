"""The bench of files: texbake and other programs on generated meshes and on a pair of files."""

from __future__ import annotations

from texbake.files import PathLike, check_folder
from texbake.jobs.outputs import JobResult
from texbake.pages.page import duration, number
from texbake.progress import ProgressSink
from texbake.study.bench.options import BenchOptions
from texbake.study.bench.result import BenchResult
from texbake.study.bench.run import run_bench
from texbake.study.bench.write import write_bench
from texbake.study.findings import amount
from texbake.study.job import read_pair
from texbake.study.plots import check_matplotlib


def bench_files(
    folder: PathLike,
    options: BenchOptions | None = None,
    *,
    high: PathLike | None = None,
    low: PathLike | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[BenchResult]:
    """Measure what accuracy costs in texbake and in other programs, and write pages and tables."""
    check_folder(folder)
    check_matplotlib("bench")
    result = run_bench(
        *read_pair("bench", high, low, progress=progress),
        options=options,
        progress=progress,
    )
    missing = [f"{name}: not installed: {reason}" for name, reason in result.missing.items()]
    failed = [
        f"{contest.task.name}, {contest.case}: {failure.program}, {failure.label}: "
        f"left out: {failure.reason}"
        for contest in result.contests
        for failure in contest.failures
    ]
    return JobResult(
        files=tuple(write_bench(result, folder, progress=progress)),
        report=result,
        warnings=tuple(missing + failed),
    )


def bench_rows(result: BenchResult) -> list[tuple[str, str, str, str, str, str]]:
    """Return a heading and, for each setting of another program, how many times as fast texbake is.

    Columns are the task and the case, the program and its setting, its error and time, texbake's
    fastest setting that is as accurate, and the other's time over its.
    """
    rows = [("task", "program", "error", "time", "texbake", "times as fast")]
    for contest in result.contests:
        for match in contest.matches():
            theirs, ours = match.theirs, match.ours
            rows.append(
                (
                    f"{contest.task.name}, {contest.case}",
                    f"{theirs.setting.series}, {theirs.setting.label}",
                    amount(theirs.error, contest.task.unit),
                    duration(theirs.median),
                    "none as accurate" if ours is None else ours.setting.label,
                    "–" if match.times_as_fast is None else number(match.times_as_fast),
                )
            )
    return rows
