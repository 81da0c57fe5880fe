"""The bench: every program does every task on every case, setting by setting, in turn.

Each run is a process of its own, timed from its start to its end: what a user waits for. Runs of
all programs are interleaved as in a study, so that what disturbs the machine for a while disturbs
all of them. A first round, which is judged, also brings the files into memory; it counts only for
settings that are slow.
"""

from __future__ import annotations

import datetime
import gc
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from texbake.errors import MeshError, OptionError
from texbake.files import PathLike, check_folder, scratch_folder
from texbake.jobs.outputs import JobResult
from texbake.mesh.files import read_mesh
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.pages.page import duration, number
from texbake.progress import Progress, Stages
from texbake.study.bench.cases import BenchCase, made_case, own_case
from texbake.study.bench.map_tasks import BenchTask, Prepared
from texbake.study.bench.programs import PROGRAMS, Finished, Product, Program, run_process
from texbake.study.bench.result import BenchResult, Contest, Failure
from texbake.study.bench.results_file import export_cases, merge_results
from texbake.study.bench.tasks import TASKS
from texbake.study.bench.write import write_bench
from texbake.study.knob import Evaluation, Experiment, Setting
from texbake.study.options import BenchOptions
from texbake.study.plots import check_matplotlib
from texbake.study.result import amount
from texbake.study.study import machine_figures, run_experiment


def run_bench(
    high: MeshLike | None = None,
    low: MeshLike | None = None,
    *,
    options: BenchOptions | None = None,
    progress: Progress = None,
) -> BenchResult:
    """Measure what accuracy costs in time and memory, in texbake and in other programs."""
    options = options or BenchOptions()
    if (high is None) != (low is None):
        raise OptionError(
            "high, low: a pair is a high-poly and a low-poly mesh; give both, or neither"
        )
    if high is None and not options.cases:
        raise OptionError("cases: none is named, and no meshes are given; name one or leave it out")
    start = time.perf_counter()
    stages = Stages(progress)
    pair = None if high is None or low is None else (as_mesh(high), as_mesh(low))
    with scratch_folder() as folder:
        versions, missing = _find_programs(options, stages)
        contests = tuple(
            _contest(task, case, prepared, sorted(versions), options, folder, stages)
            for task, case, prepared in _prepared(pair, options, folder, stages)
        )
    kept = tuple(contest for contest in contests if contest.measurements)
    if not kept:
        reasons = [failure.reason for contest in contests for failure in contest.failures]
        raise MeshError(f"bench: no program did any task; {reasons[0] if reasons else 'none fits'}")
    return BenchResult(
        options=options,
        machines={PROGRAMS[name].title: machine_figures() for name in versions},
        versions={PROGRAMS[name].title: version for name, version in versions.items()},
        missing={PROGRAMS[name].title: reason for name, reason in missing.items()},
        contests=kept,
        seconds=time.perf_counter() - start,
        inputs={} if pair is None else {"high": pair[0].name, "low": pair[1].name},
        date=datetime.date.today().isoformat(),
    )


def _find_programs(options: BenchOptions, stages: Stages) -> tuple[dict[str, str], dict[str, str]]:
    """Return the versions of the programs that are installed, and why others are not."""
    versions, missing = {}, {}
    with stages.stage("find programs"):
        for name in options.ordered_programs:
            version, reason = PROGRAMS[name].version(options)
            if version:
                versions[name] = version
            else:
                missing[name] = reason
    return versions, missing


def _prepared(
    pair: tuple[Any, Any] | None, options: BenchOptions, folder: Path, stages: Stages
) -> Iterator[tuple[BenchTask, BenchCase, Prepared]]:
    """Each task with each case that fits it; only one case is in memory at a time."""
    names = [*([None] if pair is not None else []), *options.ordered_cases]
    for name in names:
        if name is None:
            assert pair is not None
            case = own_case(*pair)
        else:
            case = made_case(name, options.made_triangles)
        for task in map(TASKS.__getitem__, options.ordered_tasks):
            with stages.stage(f"prepare {task.name}, {case.name}"):
                prepared = task.prepare(case, options, folder)
            if prepared is not None:
                yield task, case, prepared


def _contest(
    task: BenchTask,
    case: BenchCase,
    prepared: Prepared,
    names: list[str],
    options: BenchOptions,
    folder: Path,
    stages: Stages,
) -> Contest:
    programs = [PROGRAMS[name] for name in PROGRAMS if name in names]
    runs = _Runs(task, prepared, options, folder)
    settings = [
        Setting(f"{program.title}: {label}", _Run(program, label, {**prepared.job, **added}))
        for program in programs
        if task.name in program.settings
        for label, added in program.settings[task.name](options)
    ]
    experiment = Experiment(
        prepared.subject,
        prepared.truth,
        prepared.truth_text,
        tuple(settings),
        runs.work,
        runs.judge,
    )
    # In a quick run every first run counts, and is the only one.
    repeats, seconds = (1, 0.0) if options.quick else (options.repeats, options.seconds)
    title = f"{task.name}, {case.name}"
    with stages.stage(title, total=len(settings) * (repeats + 1), unit="runs") as advance:
        measured = run_experiment(
            experiment, repeats=repeats, seconds=seconds, seed=title, advance=advance,
            clock=lambda: runs.clock,
        )  # fmt: skip
    runs.close()
    measurements = []
    for item in measured:
        run = item.setting.value
        if run not in runs.faults:
            setting = Setting(run.label, run.job, run.program.title)
            measurements.append(replace(item, setting=setting, peak_bytes=runs.peaks[run]))
    gc.collect()
    return Contest(
        task, case.name, prepared.subject, prepared.truth, prepared.truth_text,
        tuple(measurements),
        tuple(Failure(r.program.title, r.label, reason) for r, reason in runs.faults.items()),
        0 if case.surface is None else options.made_triangles,
    )  # fmt: skip


class _Run:
    """A setting of a program with the whole job."""

    def __init__(self, program: Program, label: str, job: Mapping[str, Any]) -> None:
        self.program, self.label, self.job = program, label, job


class _Runs:
    """Starts processes, never again a failed one, and counts their seconds in `clock`."""

    def __init__(
        self, task: BenchTask, prepared: Prepared, options: BenchOptions, folder: Path
    ) -> None:
        self.clock = 0.0
        self.peaks: dict[_Run, int | None] = {}
        self.faults: dict[_Run, str] = {}
        self._task, self._prepared, self._options = task, prepared, options
        self._folder = tempfile.TemporaryDirectory(dir=folder)
        self._stems: dict[_Run, Path] = {}

    def work(self, run: _Run) -> Product | None:
        """Do the job; None if it fails."""
        if run in self.faults:
            return None
        there = Path(self._folder.name)
        stem = self._stems.setdefault(run, there / f"{run.program.name}-{len(self._stems)}")
        job = {**run.job, "task": self._task.name}
        command, product = run.program.command(job, stem, self._options)
        done = run_process(command, timeout=self._options.longest)
        self.clock += done.seconds
        self._note(run, done, product)
        return None if run in self.faults else product

    def close(self) -> None:
        """Remove what the programs wrote."""
        self._folder.cleanup()

    def _note(self, run: _Run, done: Finished, product: Product) -> None:
        if done.fault or not product.path.exists():
            self.faults[run] = done.fault or f"it did not write {product.path.name}"
        known = [peak for peak in (self.peaks.get(run), done.peak_bytes) if peak is not None]
        self.peaks[run] = max(known) if known else None

    def judge(self, run: _Run, product: Product | None) -> Evaluation:
        """Return how wrong a product is; a setting whose product cannot be read is left out."""
        if product is not None:
            try:
                judgment = self._prepared.judge(product)
            except (OSError, ValueError) as error:
                self.faults[run] = str(error)
            else:
                if judgment.error == judgment.error:  # not NaN
                    return judgment
                self.faults[run] = "nothing of its result can be compared"
        return Evaluation(0.0)


def bench_files(
    folder: PathLike,
    options: BenchOptions | None = None,
    *,
    high: PathLike | None = None,
    low: PathLike | None = None,
    merge: Sequence[PathLike] = (),
    run: bool = True,
    progress: Progress = None,
) -> JobResult[BenchResult]:
    """Measure accuracy and its cost in all programs, or show results to `merge` if not `run`."""
    check_folder(folder)
    check_matplotlib("bench")
    result = None
    if run or not merge:
        result = run_bench(
            *(None if path is None else read_mesh(path, progress=progress) for path in (high, low)),
            options=options,
            progress=progress,
        )
    result = merge_results(result, merge, Stages(progress))
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


def export_files(
    folder: PathLike, options: BenchOptions, *, progress: Progress = None
) -> JobResult[None]:
    """Write the cases of the bench for programs that texbake cannot start."""
    check_folder(folder)
    return JobResult(files=tuple(export_cases(folder, options, Stages(progress))), report=None)


def bench_rows(result: BenchResult) -> list[tuple[str, str, str, str, str, str]]:
    """Heading and rows: how many times as fast texbake is as each setting of other programs."""
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
