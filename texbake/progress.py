"""Stages of long work: their progress for a listener, and their times for the report.

A function that takes long accepts `progress`, an object with the three methods of `ProgressSink`,
and opens a `Stages` on it. The times of the stages are kept for the report either way.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol


class ProgressSink(Protocol):
    """Receives the progress of stages. The methods are called from one thread, in order."""

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """A stage has begun; `total` is None if the amount of work is unknown."""

    def advanced(self, stage: str, done: int) -> None:
        """Record that this many units of `total` are done."""

    def finished(self, stage: str, seconds: float) -> None:
        """A stage has ended, normally or by an error."""


@dataclass(frozen=True)
class StageRecord:
    """Time and memory of one stage.

    `peak_memory_bytes` is the peak resident memory of the process up to the end of the stage, or
    None where the system does not report it.
    """

    name: str
    seconds: float
    peak_memory_bytes: int | None


class Stages:
    """The stages of one piece of work, in order.

    >>> stages = Stages()
    >>> with stages.stage("cast rays", total=100, unit="rays") as advance:
    ...     advance(100)
    >>> [record.name for record in stages.records]
    ['cast rays']
    """

    def __init__(self, sink: ProgressSink | None = None) -> None:
        self._records: dict[str, StageRecord] = {}
        self._sink = sink

    @property
    def records(self) -> list[StageRecord]:
        """Records of the stages so far, in the order in which they first began."""
        return list(self._records.values())

    @contextmanager
    def stage(
        self, name: str, *, total: int | None = None, unit: str = "", recorded: bool = True
    ) -> Iterator[Callable[[int], None]]:
        """Report a block to the listener; yields a function to call with the units just done.

        Its time is recorded too, unless `recorded` is false because its parts are recorded one by
        one.
        """
        done = 0

        def advance(n_units: int) -> None:
            nonlocal done
            done += n_units
            if self._sink is not None:
                self._sink.advanced(name, done)

        start = time.perf_counter()
        if self._sink is not None:
            self._sink.started(name, total, unit)
        try:
            yield advance
        finally:
            seconds = time.perf_counter() - start
            if recorded:
                self._add(name, seconds)
            if self._sink is not None:
                self._sink.finished(name, seconds)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Record the time of a block without reporting it; parts of one name are added up."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self._add(name, time.perf_counter() - start)

    def _add(self, name: str, seconds: float) -> None:
        if name in self._records:
            seconds += self._records[name].seconds
        self._records[name] = StageRecord(name, seconds, peak_memory_bytes())


def peak_memory_bytes() -> int | None:
    """Peak resident memory of this process so far, or None where the system does not report it."""
    try:
        # On Linux the figure of `getrusage` includes the peak of the parent process.
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        return int(status.split("VmHWM:")[1].split()[0]) * 1024
    except (OSError, IndexError, ValueError):
        pass
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else int(peak) * 1024
