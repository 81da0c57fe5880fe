"""Runs the settings of a knob in interleaved rounds and times them.

A machine warms up, slows down and is used by others meanwhile. So settings are not timed one after
another, several times each, but in rounds in which each setting runs once, in an order that changes
from round to round: what disturbs the machine for a while disturbs all settings. The median and the
range of the rounds are reported. A round before them judges the products, and compiles and reads
whatever has to be; its time is counted only for settings that are slow.

Based on: Georges, Buytaert, Eeckhout, "Statistically rigorous Java performance evaluation", OOPSLA
2007 (rounds, ranges instead of a best time); Kalibera, Jones, "Rigorous benchmarking in reasonable
time", ISMM 2013 (order of runs).
"""

from __future__ import annotations

import gc
import os
import platform
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from texbake.study.knob import Bench, Judgment, Setting

LEAST_RUNS = 2


@dataclass(eq=False)
class Trial:
    """A setting with its measurements so far."""

    setting: Setting
    outcome: Judgment
    # Peak memory of the first timed run, in which nothing is compiled or read any more.
    peak_bytes: int | None
    seconds: list[float] = field(default_factory=list)  # time of each timed run


def run_bench(
    bench: Bench,
    *,
    repeats: int,
    seconds: float,
    seed: str = "",
    advance: Callable[[int], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Trial]:
    """Try all settings of a bench."""
    trials = [_first_run(bench, setting, seconds, clock, advance) for setting in bench.settings]
    least = min(repeats, LEAST_RUNS)
    for number in range(repeats):
        gc.collect()  # so that no round clears away what earlier ones have left
        for trial in _shuffled(trials, f"{seed} {number}"):
            if len(trial.seconds) < repeats and (
                len(trial.seconds) < least or sum(trial.seconds) < seconds
            ):
                _run(bench, trial, clock, measure_memory=number == 0)
            if advance is not None:
                advance(1)
    return trials


def _first_run(
    bench: Bench,
    setting: Setting,
    seconds: float,
    clock: Callable[[], float],
    advance: Callable[[int], None] | None,
) -> Trial:
    def work() -> tuple[object, float]:
        return _timed(lambda: bench.work(setting.value), clock)

    # This peak is the only one for a slow setting in a study of one round.
    (product, taken), peak = with_peak_memory(work)
    trial = Trial(setting, bench.judge(setting.value, product), peak)
    if taken > seconds:
        trial.seconds.append(taken)
    if advance is not None:
        advance(1)
    return trial


def _run(bench: Bench, trial: Trial, clock: Callable[[], float], *, measure_memory: bool) -> None:
    def work() -> float:
        return _timed(lambda: bench.work(trial.setting.value), clock)[1]

    if measure_memory:
        taken, trial.peak_bytes = with_peak_memory(work)
    else:
        taken = work()
    trial.seconds.append(taken)


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


def _shuffled(trials: list[Trial], seed: str) -> list[Trial]:
    order = list(trials)
    random.Random(seed).shuffle(order)
    return order


Result = TypeVar("Result")

_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")
_RESET_PEAK = "5"


def with_peak_memory(work: Callable[[], Result]) -> tuple[Result, int | None]:
    """Run `work`; return its result, and by how many bytes resident memory rose at its peak.

    The peak that Linux keeps is reset first. None where the system cannot do that.
    """
    gc.collect()
    _return_freed_memory()
    try:
        _CLEAR.write_text(_RESET_PEAK, encoding="ascii")
        before = _status_bytes("VmRSS")
    except (OSError, IndexError, ValueError):
        return work(), None
    result = work()
    return result, max(_status_bytes("VmHWM") - before, 0)


def _return_freed_memory() -> None:
    """Make the C library return freed memory to the system, which would hide a later peak."""
    import ctypes

    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError, TypeError):  # not the GNU C library
        return


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
