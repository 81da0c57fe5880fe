"""Runs the settings of a knob in interleaved rounds and times them.

A machine warms up, slows down and is used by others meanwhile. So settings are not timed one after
the other, each a few times, but in rounds in which each comes once, in an order that changes from
round to round: what disturbs the machine for a while disturbs them all. Median and range of the
rounds are told. A round before them judges the products, and is counted only for settings that
are slow; whatever has to be compiled or read is compiled and read in it.

Based on: Georges, Buytaert, Eeckhout, "Statistically rigorous Java performance evaluation", OOPSLA
2007 (rounds, ranges instead of a best time); Kalibera, Jones, "Rigorous benchmarking in reasonable
time", ISMM 2013 (order of runs).
"""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from texbake.study.knob import Bench, Outcome, Setting
from texbake.study.memory import with_peak_memory

LEAST_RUNS = 2


@dataclass(eq=False)
class Trial:
    """A setting with what it took so far.

    Attributes
    ----------
    setting : Setting
    outcome : Outcome
    peak_bytes : int or None
        Memory of the first timed run, in which nothing is compiled or read any more.
    seconds : list of float
        Of the timed runs, in their order.
    """

    setting: Setting
    outcome: Outcome
    peak_bytes: int | None
    seconds: list[float] = field(default_factory=list)


def run_bench(
    bench: Bench,
    *,
    repeats: int,
    seconds: float,
    seed: str = "",
    advance: Callable[[int], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Trial]:
    """Try all settings of a bench.

    Parameters
    ----------
    bench
        What to run.
    repeats
        Timed runs of each setting.
    seconds
        A setting whose timed runs have taken as long together is run no more, once it has been
        timed twice. A first run that alone takes as long is counted as a timed one: what quicker
        settings before it have not compiled yet is nothing beside it.
    seed
        Of the orders.
    advance
        Told of each finished run.
    clock
        Seconds.

    Returns
    -------
    list of Trial
        In the order of the settings.
    """
    trials = [_first_run(bench, setting, seconds, clock, advance) for setting in bench.settings]
    least = min(repeats, LEAST_RUNS)
    for number in range(repeats):
        gc.collect()  # what earlier rounds left is not this one's to clear away
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

    # Kept where there is no other: of a setting that is slow, in a study of one round.
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
