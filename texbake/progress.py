"""Stages of long work: what each took, and how far it is, told to whoever listens.

A function that takes long accepts `progress`, something with the three methods of `ProgressSink`,
and opens a `Stages` on it. What the stages took is kept for the report either way.
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
    """Listens to the progress of stages. The methods are called from one thread, in order."""

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """Tell that a stage has begun; `total` is None where the amount of work is unknown."""

    def advanced(self, stage: str, done: int) -> None:
        """Tell how many units of `total` are done."""

    def finished(self, stage: str, seconds: float) -> None:
        """Tell that a stage has ended, also when an error ended it."""


@dataclass(frozen=True)
class StageRecord:
    """What one stage took.

    `peak_memory_bytes` is the most resident memory the process had held up to the stage's end, or
    None where the system does not tell.
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
        """What the stages took so far, in the order in which they first began."""
        return list(self._records.values())

    @contextmanager
    def stage(
        self, name: str, *, total: int | None = None, unit: str = "", recorded: bool = True
    ) -> Iterator[Callable[[int], None]]:
        """Show a block to the listener; yields a function that takes the number of units just done.

        Its time is recorded as well unless `recorded` is false, as it is where parts of the block
        are recorded one by one.
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
        """Record a block's time without showing it; parts of one name are added up."""
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
    """Most resident memory this process has held so far, or None where the system does not tell."""
    try:
        # On Linux `getrusage` starts from what the process that started this one held.
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
