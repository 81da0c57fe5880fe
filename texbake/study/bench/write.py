"""The files of the bench: figures, plots, the page and the tables for a README."""

from __future__ import annotations

import json
from pathlib import Path

from texbake.files import PathLike, write_files
from texbake.progress import ProgressSink, Stages
from texbake.study.bench.page import bench_page, contest_plot, markdown
from texbake.study.bench.result import BenchResult

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
