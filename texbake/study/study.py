"""What accuracy costs in time: each knob tried over its range, on your own meshes and scene.

Settings run in rounds, each once per round, in an order that changes: what disturbs the machine for
a while disturbs all of them. The median and the range of the rounds are reported. A round before
them judges the products; its time is counted only for settings that are slow. The page of a study
needs no other file and no network.

Based on: Georges, Buytaert, Eeckhout, "Statistically rigorous Java performance evaluation", OOPSLA
2007 (rounds, ranges instead of a best time); Kalibera, Jones, "Rigorous benchmarking in reasonable
time", ISMM 2013 (order of runs).
"""

from __future__ import annotations

import ctypes
import gc
import json
import math
import os
import platform
import random
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from texbake.errors import MeshError, OptionError
from texbake.files import PathLike, check_folder, write_files
from texbake.jobs.outputs import JobResult
from texbake.jobs.preview_scene import with_lighting
from texbake.mesh.files import read_mesh
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.pages.page import duration, page_html, render
from texbake.pages.pictures import data_uri, png_of
from texbake.parallel import resolve_threads
from texbake.progress import Progress, Stages
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene
from texbake.study.knob import Case, Evaluation, Experiment, NotApplicable, Setting, knob_named
from texbake.study.options import StudyOptions
from texbake.study.plots import Plot, all_plot, check_matplotlib, knob_plot
from texbake.study.result import (
    KnobResult,
    Measurement,
    StudyResult,
    amount,
    figure_names,
    findings,
    next_step,
)

if TYPE_CHECKING:
    from markupsafe import Markup

LEAST_RUNS = 2


def run_experiment(
    experiment: Experiment,
    *,
    repeats: int,
    seconds: float,
    seed: str = "",
    advance: Callable[[int], None] = lambda n: None,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[Measurement, ...]:
    """Try settings `repeats` times in seeded orders, none again once it took `seconds`."""

    def run(setting: Setting) -> tuple[object, float]:
        return _timed(lambda: experiment.work(setting.value), clock)

    def seconds_of(setting: Setting) -> float:  # and free the product, which may be large
        return run(setting)[1]

    settings = experiment.settings
    outcomes: list[Evaluation] = []
    # The peak of the first timed run, in which nothing is compiled or read any more; of a slow
    # setting in a study of one round, that of the run before.
    peaks: list[int | None] = []
    times: list[list[float]] = []
    for setting in settings:
        (product, elapsed), peak = with_peak_memory(partial(run, setting))
        outcomes.append(experiment.judge(setting.value, product))
        del product
        peaks.append(peak)
        times.append([elapsed] if elapsed > seconds else [])
        advance(1)
    least = min(repeats, LEAST_RUNS)
    for number in range(repeats):
        gc.collect()  # so that no round clears away what earlier ones have left
        order = list(range(len(settings)))
        random.Random(f"{seed} {number}").shuffle(order)
        for i in order:
            n = len(times[i])
            if n < repeats and (n < least or sum(times[i]) < seconds):
                if number == 0:
                    elapsed, peaks[i] = with_peak_memory(partial(seconds_of, settings[i]))
                else:
                    elapsed = seconds_of(settings[i])
                times[i].append(elapsed)
            advance(1)
    return tuple(
        Measurement(setting, outcome, tuple(runs), peak)
        for setting, outcome, runs, peak in zip(settings, outcomes, times, peaks, strict=True)
    )


def _timed(work: Callable[[], object], clock: Callable[[], float]) -> tuple[object, float]:
    enabled = gc.isenabled()
    gc.disable()
    try:
        start = clock()
        product = work()
        return product, clock() - start
    finally:
        if enabled:
            gc.enable()


Result = TypeVar("Result")

_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")
_RESET_PEAK = "5"


def with_peak_memory(work: Callable[[], Result]) -> tuple[Result, int | None]:
    """Run `work`; return its result, and the bytes that its peak adds; None if unknown."""
    gc.collect()
    # Freed memory that is not returned would hide a later peak.
    with suppress(OSError, AttributeError, TypeError):  # not the GNU C library
        ctypes.CDLL(None).malloc_trim(0)
    try:
        _CLEAR.write_text(_RESET_PEAK, encoding="ascii")
        before = _status_bytes("VmRSS")
    except (OSError, IndexError, ValueError):
        return work(), None
    result = work()
    return result, max(_status_bytes("VmHWM") - before, 0)


def _status_bytes(field: str) -> int:
    status = _STATUS.read_text(encoding="ascii", errors="replace")
    return int(status.split(f"{field}:")[1].split()[0]) * 1024


_CPUS, _MEMORY = Path("/proc/cpuinfo"), Path("/proc/meminfo")


def machine_figures() -> dict[str, Any]:
    """Return system, processor, number of processors, memory and Python, as far as known."""
    figures: dict[str, Any] = {
        "system": platform.system(),
        "processor": platform.machine(),
        "processors": os.cpu_count() or 1,
        "python": platform.python_version(),
    }
    model = _field(_CPUS, "model name")
    if model:
        figures["model"] = model
    memory = _field(_MEMORY, "MemTotal")
    if memory:
        figures["memory_bytes"] = int(memory.split()[0]) * 1024
    return figures


def _field(path: Path, name: str) -> str:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    found = (line.partition(":") for line in lines)
    return next((value.strip() for key, _, value in found if key.strip() == name), "")


PAGE, JSON, ALL_PLOT = "study.html", "study.json", "all.png"


def write_study(result: StudyResult, folder: PathLike, *, progress: Progress = None) -> list[Path]:
    """Write everything that a study measured."""
    check_matplotlib()
    stages = Stages(progress)
    with stages.stage("draw plots", total=len(result.knobs) + 1, unit="plots") as advance:
        plots = {}
        for item in result.knobs:
            plots[item.knob.name] = knob_plot(item)
            advance(1)
        everything = all_plot(result.knobs)
        advance(1)
    with stages.stage("write"):
        files = {
            PAGE: study_page(result, plots, everything).encode("utf-8"),
            JSON: (json.dumps(result.to_json(), indent=2) + "\n").encode("utf-8"),
            ALL_PLOT: everything.png,
            **{f"{name}.png": plot.png for name, plot in plots.items()},
        }
        return write_files(folder, files)


TEMPLATES = Path(__file__).with_name("templates")
PAGE_STYLE = """
.truth { display: inline-block; border-radius: 1rem; padding: .05rem .7rem; font-size: .8rem;
  border: 1px solid var(--line); background: var(--wash); margin-right: .4rem;
  white-space: nowrap; }
ul.findings { margin: .5rem 0 1rem; padding-left: 1.2rem; max-width: 46rem; }
ul.findings li { margin: .25rem 0; }
.wide svg { display: block; width: 100%; height: auto; }
.plot svg { min-width: 30rem; max-width: 46rem; }
.all svg { min-width: 48rem; }
th, td { white-space: nowrap; }
th { white-space: normal; vertical-align: bottom; min-width: 4.5rem; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; position: sticky; left: 0;
  background: var(--paper); }
td.words, th.words { text-align: left; min-width: 9rem; white-space: normal; }
tr.front td:first-child { font-weight: 600; }
tr.kept td { background: var(--kept); }
.range { color: var(--faint); font-size: .8rem; white-space: nowrap; }
.crops { display: grid; grid-template-columns: repeat(auto-fill, minmax(140px, 1fr)); gap: .75rem; }
@media (max-width: 600px) {
  th:first-child, td:first-child { white-space: normal; min-width: 6.5rem; max-width: 8rem; }
  .crops { grid-template-columns: repeat(auto-fill, minmax(104px, 1fr)); }
}
"""

TITLE = "What accuracy costs in time"
_INPUTS = {"high": "high-poly mesh", "low": "low-poly mesh", "scene": "scene"}


def study_page(result: StudyResult, plots: Mapping[str, Plot], everything: Plot) -> str:
    """Return the page as HTML."""
    body = render(
        "study.html",
        folder=TEMPLATES,
        title=TITLE,
        result=result,
        inputs=_INPUTS,
        everything=titled(everything.svg, "All settings of all knobs"),
        plots={
            item.knob.name: titled(plots[item.knob.name].svg, item.knob.title)
            for item in result.knobs
        },
        amount=amount,
        figure_names=figure_names,
        findings=findings,
        next_step=next_step,
        uri_of=crop_uri,
    )
    # The plots are drawn on white.
    return page_html(TITLE, body, styles=[PAGE_STYLE], dark=False)


def crop_uri(item: Measurement) -> str:
    """Return the crop of a setting that has one."""
    assert item.outcome.picture is not None
    return data_uri(png_of(item.outcome.picture))


def titled(svg: str, title: str) -> Markup:
    """SVG of a plot with a name for screen readers."""
    from markupsafe import Markup, escape

    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1))


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
