"""What accuracy costs in time: each knob tried over its range, on your own meshes and scene."""

from __future__ import annotations

import math
import time

from texbake.errors import MeshError, OptionError
from texbake.files import PathLike, check_folder
from texbake.jobs.outputs import JobResult
from texbake.jobs.preview_scene import with_lighting
from texbake.mesh.files import read_mesh
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.pages.page import duration
from texbake.parallel import resolve_threads
from texbake.progress import Progress, Stages
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene
from texbake.study.findings import amount
from texbake.study.knob import Case, NotApplicable, knob_named
from texbake.study.options import StudyOptions
from texbake.study.plots import check_matplotlib
from texbake.study.result import KnobResult, StudyResult
from texbake.study.runner import machine_figures, run_experiment
from texbake.study.write import write_study

_QUICK_REPEATS = 2


def run_study(
    high: MeshLike | None = None,
    low: MeshLike | None = None,
    *,
    scene: Scene | None = None,
    options: StudyOptions | None = None,
    progress: Progress = None,
) -> StudyResult:
    """Measure how accurate settings are, and how much time and memory they cost."""
    high = None if high is None else as_mesh(high)
    low = None if low is None else as_mesh(low)
    options = options or StudyOptions()
    if (high is None) != (low is None):
        raise OptionError(
            "high, low: a pair is a high-poly and a low-poly mesh; give both, or neither"
        )
    start = time.perf_counter()
    shown = None if scene is None else with_lighting(scene)
    case = Case(high, low, shown, quick=options.quick, threads=options.threads)
    stages = Stages(progress)
    results = {name: _studied(name, case, options, stages) for name in options.ordered_knobs}
    skipped = {
        name: item.reason for name, item in results.items() if isinstance(item, NotApplicable)
    }
    if len(skipped) == len(results):
        name, reason = next(iter(skipped.items()))
        raise MeshError(f"study {name}: {reason}; study other knobs or meshes")
    return StudyResult(
        options=options,
        inputs={
            key: item.name
            for key, item in (("high", high), ("low", low), ("scene", scene))
            if item is not None
        },
        machine={**machine_figures(), "threads": resolve_threads(options.threads)},
        knobs=tuple(item for item in results.values() if isinstance(item, KnobResult)),
        skipped=skipped,
        seconds=time.perf_counter() - start,
    )


def _studied(
    name: str, case: Case, options: StudyOptions, stages: Stages
) -> KnobResult | NotApplicable:
    knob = knob_named(name)
    with stages.stage(f"prepare {name}"):
        experiment = knob.prepare(case)
    if isinstance(experiment, NotApplicable):
        return experiment
    repeats = min(options.repeats, _QUICK_REPEATS) if options.quick else options.repeats
    n_runs = len(experiment.settings) * (repeats + 1)
    try:
        with stages.stage(name, total=n_runs, unit="runs") as advance:
            measurements = run_experiment(
                experiment, repeats=repeats, seconds=options.seconds, seed=name, advance=advance
            )
    finally:
        experiment.close()
    subject = experiment.subject
    if not all(math.isfinite(item.error) for item in measurements):
        return NotApplicable(f"nothing of {subject} shows where it is compared, so it has no error")
    return KnobResult(
        knob=knob,
        subject=subject,
        truth=experiment.truth,
        truth_text=experiment.truth_text,
        measurements=measurements,
    )


def study_files(
    folder: PathLike,
    options: StudyOptions | None = None,
    *,
    high: PathLike | None = None,
    low: PathLike | None = None,
    scene: PathLike | None = None,
    progress: Progress = None,
) -> JobResult[StudyResult]:
    """Measure what each setting gains and costs, and write pages, plots and figures."""
    check_folder(folder)
    check_matplotlib()
    result = run_study(
        *(None if path is None else read_mesh(path, progress=progress) for path in (high, low)),
        scene=None if scene is None else read_scene(scene, progress=progress),
        options=options or StudyOptions(),
        progress=progress,
    )
    return JobResult(
        files=tuple(write_study(result, folder, progress=progress)),
        report=result,
        warnings=tuple(
            f"study {name}: left out: {reason}" for name, reason in result.skipped.items()
        ),
    )


def study_rows(result: StudyResult) -> list[tuple[str, str, str, str]]:
    """Return rows of a heading and of each knob's best setting: its name, error and time."""
    rows = [("knob", "pays up to", "error", "time")]
    for item in result.knobs:
        for best in item.knees:
            kept = item.measurements[best]
            error = amount(kept.error, item.knob.unit)
            rows.append((item.knob.name, kept.setting.label, error, duration(kept.median)))
    return rows
