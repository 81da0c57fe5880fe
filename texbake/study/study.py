"""What accuracy costs in time: each knob tried over its range, on your own meshes and scene."""

from __future__ import annotations

import math
import time
from typing import Any

from texbake.errors import MeshError, OptionError
from texbake.jobs.preview_scene import with_lighting
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.parallel import resolve_threads
from texbake.progress import ProgressSink, Stages
from texbake.rendering.scene.scene import Scene
from texbake.study.case import Case
from texbake.study.knob import Unfit
from texbake.study.knobs import knob_named
from texbake.study.options import StudyOptions
from texbake.study.result import KnobResult, Measurement, StudyResult
from texbake.study.runner import machine_figures, run_bench

_QUICK_REPEATS = 2


def run_study(
    high: MeshLike | None = None,
    low: MeshLike | None = None,
    *,
    scene: Scene | None = None,
    options: StudyOptions | None = None,
    progress: ProgressSink | None = None,
) -> StudyResult:
    """Measure how accurate settings are, and how much time and memory they cost."""
    high = None if high is None else as_mesh(high)
    low = None if low is None else as_mesh(low)
    options = options or StudyOptions()
    if (high is None) != (low is None):
        raise OptionError("study: a pair is a high-poly and a low-poly mesh; give both, or none")
    start = time.perf_counter()
    shown = None if scene is None else with_lighting(scene)
    case = Case(high, low, shown, quick=options.quick, threads=options.threads)
    stages = Stages(progress)
    results = {name: _studied(name, case, options, stages) for name in options.ordered_knobs}
    skipped = {name: item.reason for name, item in results.items() if isinstance(item, Unfit)}
    if len(skipped) == len(results):
        name, reason = next(iter(skipped.items()))
        raise MeshError(f"study {name}: {reason}; study other knobs or meshes")
    return StudyResult(
        options=options,
        inputs=_inputs(high, low, scene),
        machine=_machine(options),
        knobs=tuple(item for item in results.values() if isinstance(item, KnobResult)),
        skipped=skipped,
        seconds=time.perf_counter() - start,
    )


def _studied(name: str, case: Case, options: StudyOptions, stages: Stages) -> KnobResult | Unfit:
    knob = knob_named(name)
    with stages.stage(f"prepare {name}"):
        bench = knob.prepare(case)
    if isinstance(bench, Unfit):
        return bench
    repeats = min(options.repeats, _QUICK_REPEATS) if options.quick else options.repeats
    n_runs = len(bench.settings) * (repeats + 1)
    try:
        with stages.stage(name, total=n_runs, unit="runs") as advance:
            trials = run_bench(
                bench, repeats=repeats, seconds=options.seconds, seed=name, advance=advance
            )
    finally:
        bench.close()
    if not all(math.isfinite(trial.outcome.error) for trial in trials):
        return Unfit(f"nothing of {bench.subject} shows where it is compared, so it has no error")
    return KnobResult(
        knob=knob,
        subject=bench.subject,
        truth=bench.truth,
        truth_text=bench.truth_text,
        measurements=tuple(map(Measurement.of, trials)),
    )


def _inputs(high: Mesh | None, low: Mesh | None, scene: Scene | None) -> dict[str, str]:
    given = {"high": high, "low": low, "scene": scene}
    return {key: item.name for key, item in given.items() if item is not None}


def _machine(options: StudyOptions) -> dict[str, Any]:
    return {**machine_figures(), "threads": resolve_threads(options.threads)}
