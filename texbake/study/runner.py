"""Runs the settings of a knob in interleaved rounds and times them.

Settings run in rounds, each once per round, in an order that changes: what disturbs the machine for
a while disturbs all of them. The median and the range of the rounds are reported. A round before
them judges the products; its time is counted only for settings that are slow.

Based on: Georges, Buytaert, Eeckhout, "Statistically rigorous Java performance evaluation", OOPSLA
2007 (rounds, ranges instead of a best time); Kalibera, Jones, "Rigorous benchmarking in reasonable
time", ISMM 2013 (order of runs).
"""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import random
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from texbake.study.knob import Evaluation, Experiment, Setting
from texbake.study.result import Measurement

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
