"""Rounds of samples, each to a closer bound on the error, until a time budget is spent.

Each round refines the first samples to a bound that is closer than the one before. Samples are
kept, and the next round takes only what its bound asks for besides: the result is what the bound
alone gives, so that the same bytes can be made again, on any machine.

How much work a bound is follows from the estimated errors, and how long work takes from the samples
taken so far. A round spends only a part of the time that is left. One that would not end in time is
given up, and followed by one to a wider bound.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import Any, Protocol

import numpy as np

from texbake.core import portable_math as pm
from texbake.limits import parse_seconds
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.progress import process_age
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True)
class BudgetClock:
    """When the time of a budget began, and what it includes beside the work itself."""

    # the time of `now` when it began; by default, the present
    start: float = field(default_factory=time.perf_counter)
    now: Callable[[], float] = time.perf_counter  # returns the time in seconds
    # called with a line of text as soon as it is known that the time is too short
    warn: Callable[[str], None] | None = None
    # Called with a part of the result to time what follows the work, such as writing files. The
    # type of that part depends on the work.
    finish: Callable[[Any], None] | None = None

    @classmethod
    def of_process(cls, warn: Callable[[str], None] | None = None) -> BudgetClock:
        """Return the clock that began with this process."""
        return cls(start=time.perf_counter() - process_age(), warn=warn)

    @property
    def spent(self) -> float:
        """Seconds since it began."""
        return self.now() - self.start


@dataclass(frozen=True)
class Round:
    """One round of samples."""

    max_error: str
    predicted_seconds: float
    seconds: float
    is_complete: bool = True  # whether it ended in time


@dataclass(frozen=True)
class TimeBudget:
    """What a time budget led to; all times are wall-clock seconds."""

    work: str  # what takes the time, `the bake` or `the picture`
    seconds: float  # the time budget
    max_error: str  # the bound that was reached; the same bytes come again with it
    why: str  # why it is not closer
    # predicted time of the first samples and everything else that is needed: the least budget
    least_seconds: float
    # from the beginning to the first samples: reading files, building the ray tree and so on
    before_seconds: float
    rounds: tuple[Round, ...]  # in their order
    actual_seconds: float = 0.0  # of everything, except what is left to do when this is reported

    @property
    def choice(self) -> str:
        """The option that gives the same bytes."""
        return f"`max_error={self.max_error}`"

    @property
    def warnings(self) -> list[str]:
        """One, if the time was exceeded."""
        if self.actual_seconds <= self.seconds:
            return []
        return [
            f"{self.work} took {self.actual_seconds:.2f} s with {self.choice}, longer than its "
            f"time budget of {self.seconds:.4g} s; use a smaller size"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        rounds = ", ".join(
            f"{one.max_error} in {one.seconds:.2f} s{'' if one.is_complete else ' (given up)'}"
            for one in self.rounds
        )
        return [
            (
                "time budget",
                f"{self.seconds:.4g} s: {self.why}; {self.choice} gives the same bytes",
            ),
            (
                "time taken",
                f"{self.actual_seconds:.2f} s, {self.before_seconds:.2f} s of it before the first "
                f"samples; {rounds}",
            ),
        ]


def with_actual_time(budget: TimeBudget, clock: BudgetClock) -> TimeBudget:
    """Return the report with the time that was spent up to now."""
    return replace(budget, actual_seconds=clock.spent)


# Eight measured figures, and what follows from them.
# The share of the time to spend; timings on shared machines differ by the rest. A round is
# abandoned once half of that rest is spent, and none begins with less than that rest left.
_SPENT_SHARE = 0.96
_LIMIT = (1.0 + _SPENT_SHARE) / 2.0
_LEAST_SHARE = 1.0 - _SPENT_SHARE
# How far the predicted time of a round may be off. A round is chosen to leave that share of the
# time; the first one, whose work is not well known, twice as much, and the last one half as much.
# After an abandoned round, later ones are predicted to take longer by that share.
_OFF = 0.3
_FIRST_SHARE, _NEXT_SHARE, _LAST_SHARE = 1.0 - 2.0 * _OFF, 1.0 - _OFF, 1.0 - _OFF / 2.0
_GIVEN_UP = 1.0 + _OFF
# One round changes the predictions for later ones by this factor at most.
_MOST_CHANGE = 2.0
# The share of the overhead of a round that is still to come while its samples are taken; a round
# after it adds a whole one.
_TO_COME = 0.5
_ANOTHER = 1.0 + _TO_COME
# The share of an abandoned round's samples that the next round uses, and the share of a round's
# overhead that grows with all samples, old and new.
_USED, _GROWING = 0.8, 0.7
# Errors are counted in bins: the number of bins per doubling, and of doublings.
_STEPS, _OCTAVES = 64, 16

_NOTHING = float("inf")  # the bound before the first round


class OutOfTimeError(Exception):
    """The time of a round is over."""


class Refinable(Protocol):
    """Texels or pixels refined in rounds; bounds are multiples of the closest that is wanted."""

    def name_of(self, bound: float) -> str:
        """Return a bound as the value of `max_error`."""

    def refine(self, bound: float) -> None:
        """Take the samples of a bound; `OutOfTimeError` leaves the result of the round before."""

    def predicted_errors(self) -> tuple[Float32Array, Float32Array]:
        """Estimated errors in closest bounds, and the work of each in a round to one below."""

    def work_done(self) -> tuple[float, float]:
        """Return the work so far, and the seconds that it took itself, without any overhead."""


class Rounds:
    """Chooses bounds of rounds; `growths`: cost over what is known, of the first and later ones."""

    def __init__(
        self, budget: str | float, work: str, clock: BudgetClock, growths: tuple[float, float]
    ) -> None:
        self.seconds = parse_seconds(budget)
        self.work, self.clock = work, clock
        self.before = clock.spent  # seconds from the beginning to the first samples
        self.after = 0.0  # predicted seconds of everything that follows the last round
        # Seconds per unit of work, and those that a round takes beside its work; all work so far.
        self.unit = self.overhead = self.total = 0.0
        self._growth, self._later_growth = growths
        self._sampling = 0.0  # seconds per unit of work without overhead
        self._kept = 0.0  # work of rounds given up, which another round uses
        self._done: list[Round] = []
        self._reached = _NOTHING
        self._max_error = ""
        self._is_least = True  # the round has the widest bound, and there is no other result
        self._least = 0.0
        self._is_warned = False

    def learn_first(
        self, *, unit: float, total: float, overhead: float, after: float, certain: float = 0.0
    ) -> None:
        """Note what first samples show before `run`, `certain` seconds even for the widest."""
        self.unit, self.total, self.overhead, self.after = unit, total, overhead, after
        self.expect_at_least(self.clock.spent + after + overhead + certain)

    def expect_at_least(self, seconds: float, *, margin: float = 1.0) -> None:
        """Note a least time, up to `margin` times too long; say at once if it is over budget."""
        self._least = seconds
        if seconds > margin * self.seconds and not self._is_warned and self.clock.warn is not None:
            self._is_warned = True
            self.clock.warn(
                f"time_budget: {self.seconds:.4g} s is too short: {self.work} takes about "
                f"{seconds:.3g} s even with the fewest samples, which it now uses"
            )

    def check(self, seconds: float = 0.0) -> None:
        """Raise `OutOfTimeError` if a round, with `seconds` to come, is late, unless the least."""
        # Where there is no result yet, another round must follow.
        overheads = _TO_COME if self._reached < _NOTHING else _ANOTHER
        needed = seconds + self.after + overheads * self.overhead
        if not self._is_least and self.clock.spent + needed > _LIMIT * self.seconds:
            raise OutOfTimeError

    def run(self, refining: Refinable) -> TimeBudget:
        """Refine until the time is spent; return the report, still without the actual time."""
        errors, costs = refining.predicted_errors()
        while (choice := self._next(_work_above(errors, costs))) is not None:
            bound, known, predicted = choice
            name, start = refining.name_of(bound), self.clock.spent
            before = refining.work_done()
            try:
                refining.refine(bound)
                is_complete = True
            except OutOfTimeError:
                is_complete = False
            seconds = self.clock.spent - start
            work, sampling = np.subtract(refining.work_done(), before).tolist()
            self._done.append(Round(name, predicted, seconds, is_complete))
            if is_complete:
                self._learn(known, work, seconds, sampling)
                self._reached, self._max_error, self._kept = bound, name, 0.0
                errors, costs = refining.predicted_errors()
            else:
                self._growth *= _GIVEN_UP
                self._kept += work
        return TimeBudget(
            work=self.work,
            seconds=self.seconds,
            max_error=self._max_error,
            why=self._why(),
            least_seconds=self._least,
            before_seconds=self.before,
            rounds=tuple(self._done),
        )

    def _next(self, work: FloatArray) -> tuple[float, float, float] | None:
        """Closest bound whose round is predicted to fit, its work and seconds; None to end."""
        if self._reached <= 1.0:
            return None
        left = _SPENT_SHARE * self.seconds - self.clock.spent - self.after
        needed = self._growth * work
        seconds = self.overhead + self.unit * (needed - np.minimum(_USED * self._kept, needed))
        fitting = np.flatnonzero(seconds <= self._time_of_round(left, float(seconds[0])))
        step = int(fitting[0]) if len(fitting) else len(work) - 1
        bound = float(pm.power(2.0, step / _STEPS))
        if self._reached < _NOTHING and (
            len(fitting) == 0 or left < _LEAST_SHARE * self.seconds or bound >= self._reached
        ):
            return None
        self._is_least = self._reached == _NOTHING and step == len(work) - 1
        return bound, float(work[step]), float(seconds[step])

    def _why(self) -> str:
        """Why the bound is not closer."""
        if self._reached <= 1.0:
            return "the closest bound that is wanted"
        return "the fewest samples" if self._is_least else "the closest bound that fits"

    def _time_of_round(self, left: float, to_closest: float) -> float:
        """Seconds that a round may take of those that are left; less if another one follows."""
        if not self._done:
            return _FIRST_SHARE * left
        has_no_other = (1.0 - _NEXT_SHARE) * left < _ANOTHER * self.overhead
        is_last = has_no_other or to_closest <= _LAST_SHARE * left
        return (_LAST_SHARE if is_last else _NEXT_SHARE) * left

    def _learn(self, known: float, work: float, seconds: float, sampling: float) -> None:
        """Learn what a round took beside `known` errors, and how much of it without overhead."""
        if self._reached == _NOTHING:
            self._growth = self._later_growth
        elif known > 0.0:
            self._growth = _towards(self._growth, work / known)
        self.total += work
        self.overhead = seconds - sampling
        if work > 0.0:
            # The overhead grows with all work.
            self._sampling = _towards(self._sampling or self.unit, sampling / work)
            self.unit = self._sampling + _GROWING * self.overhead / self.total


def _towards(before: float, measured: float) -> float:
    """Return what was measured, unless it differs too much from what was predicted."""
    return min(max(measured, before / _MOST_CHANGE), before * _MOST_CHANGE)


def _work_above(errors: Float32Array, costs: Float32Array) -> FloatArray:
    """Work for each bound from 1 to the widest: the costs of all errors above it."""
    is_above = errors > 1.0
    steps = np.minimum(_STEPS * pm.log2(errors[is_above]), _STEPS * _OCTAVES)
    # An error between two bounds costs where the bound is the lower one of these.
    sums = np.bincount(
        steps.astype(np.int64), weights=costs[is_above], minlength=_STEPS * _OCTAVES + 1
    )
    return np.asarray(np.cumsum(sums[::-1])[::-1])


def spread_rows(n: int, n_chosen: int, n_runs: int) -> Sequence[range]:
    """Return runs that together have `n_chosen` of `n` rows, spread evenly; all of few rows.

    >>> spread_rows(100, 8, 2)
    [range(23, 27), range(73, 77)]
    >>> spread_rows(6, 8, 2)
    [range(0, 6)]
    """
    if n <= n_chosen:
        return [range(n)]
    length = n_chosen // n_runs
    middles = ((np.arange(n_runs) + 0.5) * n / n_runs).astype(int).tolist()
    return [range(middle - length // 2, middle - length // 2 + length) for middle in middles]
