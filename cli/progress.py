"""Progress in a file or a pipe, where bars cannot be drawn, as lines for people or as JSON."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from typing import IO, Self

from texbake.records import dataclass

# Before its length is estimated, a stage is timed for this long, and for this share of its work or
# the longer time: the first units also load libraries and wait for other programs.
_TIMED, _LEAST_SHARE, _TIMED_LONG = 3.0, 0.1, 30.0
# The state of a shorter stage would be "0 s".
_SHOWN = 0.5
# Shorter stages are not announced.
_LONG = 60.0


@dataclass
class TimedStage:
    """A stage that runs, and how much of it is done."""

    name: str
    total: int | None  # None if the amount of work is unknown
    unit: str
    begun: float  # when, in seconds
    done: int = 0
    is_announced: bool = False

    def announcement(self, now: float) -> str | None:
        """Say, once and in its first half, how long the stage takes, if more than a minute."""
        seconds = now - self.begun
        if self.is_announced or not self.total or seconds < _TIMED or not self._is_steady(seconds):
            return None
        expected = seconds * self.total / self.done
        self.is_announced = expected > _LONG and 2 * self.done < self.total
        return f"{self.name} takes about {rounded(expected)}" if self.is_announced else None

    def state(self, now: float) -> str:
        """How much is done and how long the rest takes, or only for how long it has run."""
        seconds = now - self.begun
        if not self.total or not self.done:
            return f"{self.name}: {rounded(seconds)}"
        state = f"{self.name}: {100 * self.done // self.total} % in {rounded(seconds)}"
        if not self._is_steady(seconds):
            return state
        return f"{state}, about {rounded(seconds * (self.total - self.done) / self.done)} left"

    def _is_steady(self, seconds: float) -> bool:
        """Whether enough is done to tell from it how long the rest takes."""
        return self.done > (0 if seconds >= _TIMED_LONG else _LEAST_SHARE * (self.total or 0))


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


class ShownProgress:
    """A `ProgressSink` that keeps the running stages; `show` is for subclasses."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.clock = clock
        self.running: dict[str, TimedStage] = {}

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """Begin to time a stage."""
        self.running[stage] = TimedStage(stage, total, unit, self.clock())
        self.show("started", self.running[stage], 0.0)

    def advanced(self, stage: str, done: int) -> None:
        """Record the amount of work done."""
        timed = self.running[stage]
        timed.done = done
        self.show("advanced", timed, self.clock() - timed.begun)

    def finished(self, stage: str, seconds: float) -> None:
        """Forget a stage."""
        self.show("finished", self.running.pop(stage), seconds)

    def show(self, event: str, stage: TimedStage, seconds: float) -> None:
        """Show that a stage has started, advanced or finished, `seconds` after it began."""


class JsonLines(ShownProgress):
    """Progress as JSON, one object per line, for other programs, at most ten per second.

    `event` is `started`, `advanced` or `finished`; `total` is null if the amount is unknown.
    """

    INTERVAL = 0.1  # seconds

    def __init__(self, stream: IO[str]) -> None:
        super().__init__()
        self._stream = stream
        self._reported = 0.0

    def show(self, event: str, stage: TimedStage, seconds: float) -> None:
        """Print a JSON object; while a stage advances, at most one per `INTERVAL`."""
        if event == "advanced":
            now = self.clock()
            if now - self._reported < self.INTERVAL:
                return
            self._reported = now
        line = {
            "event": event,
            "stage": stage.name,
            "done": stage.done,
            "total": stage.total,
            "unit": stage.unit,
            "seconds": round(seconds, 3),
        }
        self._stream.write(json.dumps(line) + "\n")
        self._stream.flush()


class Lines(ShownProgress):
    """Prints the state of the innermost stage every ten seconds; nothing of short work."""

    INTERVAL = 10.0  # seconds

    def __init__(
        self, write: Callable[[str], None], clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(clock)
        self._write = write
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()  # it may be printing

    def show(self, event: str, stage: TimedStage, seconds: float) -> None:
        """Announce a long stage."""
        if event == "advanced" and (text := stage.announcement(self.clock())) is not None:
            self._write(text)

    def tick(self) -> None:
        """Print the state of the innermost stage, but for one that has just begun."""
        now = self.clock()
        running = [timed for timed in self.running.values() if now - timed.begun >= _SHOWN]
        if running:
            self._write(running[-1].state(now))

    def _run(self) -> None:
        while not self._ended.wait(self.INTERVAL):
            self.tick()
