"""A time budget: the clock that it is counted on, and the report of what it led to.

The rounds of samples that spend the time are in `texbake.sampling.rounds`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any


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
        return cls(start=_process_start(), warn=warn)

    @property
    def spent(self) -> float:
        """Seconds since it began."""
        return self.now() - self.start


def _process_start() -> float:
    """Return `time.perf_counter` as it was when this process began.

    If the system does not report it, the processor time stands for the age of the process.
    """
    try:
        # The 22nd field, in ticks since the machine began; the second may hold spaces.
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace")
        ticks = int(fields.rpartition(")")[2].split()[19])
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError, IndexError, ValueError):
        age = time.process_time()
    return time.perf_counter() - age


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
