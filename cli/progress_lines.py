"""Progress in a file or a pipe, where bars cannot be drawn; and how long a stage will take."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

# A stage is timed for this long before its length is estimated.
_TIMED = 3.0
# The state of a shorter stage would be "0 s".
_SHOWN = 0.5
# Shorter stages are not announced.
_LONG = 60.0


@dataclass
class TimedStage:
    """A stage that runs, and how much of it is done."""

    name: str
    total: int | None  # None if the amount of work is unknown
    begun: float  # when, in seconds
    done: int = 0
    is_announced: bool = False

    def announcement(self, now: float) -> str | None:
        """Say, once and in its first half, how long the stage takes, if more than a minute."""
        seconds = now - self.begun
        if self.is_announced or not self.total or not self.done or seconds < _TIMED:
            return None
        expected = seconds * self.total / self.done
        self.is_announced = expected > _LONG and 2 * self.done < self.total
        return f"{self.name} takes about {rounded(expected)}" if self.is_announced else None

    def state(self, now: float) -> str:
        """How much is done and how long the rest takes, or only for how long it has run."""
        seconds = now - self.begun
        if not self.total or not self.done:
            return f"{self.name}: {rounded(seconds)}"
        left = seconds * (self.total - self.done) / self.done
        percent = 100 * self.done // self.total
        return f"{self.name}: {percent} % in {rounded(seconds)}, about {rounded(left)} left"


def rounded(seconds: float) -> str:
    """Format a duration with two digits at most.

    >>> rounded(8.3), rounded(170.0), rounded(5400.0)
    ('8 s', '3 min', '1.5 h')
    """
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    if seconds < 99.5 * 60.0:
        return f"{seconds / 60.0:.0f} min" if seconds >= 570.0 else f"{seconds / 60.0:.2g} min"
    return f"{seconds / 3600.0:.2g} h"


class Lines:
    """A `ProgressSink` that prints the state of the innermost stage every ten seconds.

    Work of less than ten seconds prints nothing. A stage of more than a minute is announced once
    the first part of it has been timed.
    """

    INTERVAL = 10.0  # seconds

    def __init__(
        self, write: Callable[[str], None], clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._write, self._clock = write, clock
        self._stages: dict[str, TimedStage] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._thread.join()  # it may be printing

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """Begin to time a stage."""
        self._stages[stage] = TimedStage(stage, total, self._clock())

    def advanced(self, stage: str, done: int) -> None:
        """Note how much is done; announce a long stage."""
        timed = self._stages[stage]
        timed.done = done
        text = timed.announcement(self._clock())
        if text is not None:
            self._write(text)

    def finished(self, stage: str, seconds: float) -> None:
        """Forget the stage."""
        del self._stages[stage]

    def tick(self) -> None:
        """Print the state of the innermost stage, but for one that has just begun."""
        now = self._clock()
        running = [timed for timed in self._stages.values() if now - timed.begun >= _SHOWN]
        if running:
            self._write(running[-1].state(now))

    def _run(self) -> None:
        while not self._ended.wait(self.INTERVAL):
            self.tick()
