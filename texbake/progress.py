"""Stages of long work: their progress for a listener, and their times for the report.

A function that takes long accepts `progress`, an object with the three methods of `ProgressSink` or
one function, and opens a `Stages` on it. An exception that a listener raises cancels the work. The
times of the stages are kept for the report either way. Where a command has opened `process_times`,
each second of the process counts for exactly one stage.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Protocol, TextIO, runtime_checkable

from texbake.errors import CancelledError, OptionError, quoted
from texbake.records import dataclass


@runtime_checkable
class ProgressSink(Protocol):
    """Receives the progress of stages. The methods are called from one thread, in order."""

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """A stage has begun; `total` is None if the amount of work is unknown."""

    def advanced(self, stage: str, done: int) -> None:
        """Record that this many units of `total` are done."""

    def finished(self, stage: str, seconds: float) -> None:
        """A stage has ended, normally or by an error."""


class ProgressBar:
    """Shows the running stage on stderr, in a terminal or notebook, for `progress=True`."""

    INTERVAL = 0.1  # seconds between two states of a stage
    _CELLS = 24

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._is_file = not (self._stream.isatty() or "ipykernel" in sys.modules)
        self._running: dict[str, tuple[float, int | None]] = {}
        self._shown = 0.0  # when
        self._width = 0  # characters on the line

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """Begin to time a stage."""
        self._running[stage] = (time.perf_counter(), total)

    def advanced(self, stage: str, done: int) -> None:
        """Draw the bar of a stage again, ten times per second at most."""
        now = time.perf_counter()
        if self._is_file or now - self._shown < self.INTERVAL:
            return
        self._shown = now
        begun, total = self._running[stage]
        bar = ""
        if total:
            cells = "#" * (self._CELLS * done // total)
            bar = f" [{cells:.<{self._CELLS}}] {100 * done // total} %"
        self._write(f"{stage}{bar} {now - begun:.1f} s")

    def finished(self, stage: str, seconds: float) -> None:
        """Replace the bar of a stage by its time."""
        del self._running[stage]
        if seconds >= self.INTERVAL:
            self._write(f"{stage}: {seconds:.1f} s")
            self._stream.write("\n")
        elif self._width:
            self._write("")
            self._stream.write("\r")
        self._width = 0

    def _write(self, text: str) -> None:
        self._stream.write(text if self._is_file else f"\r{text:<{self._width}}")
        self._stream.flush()
        self._width = len(text)


class _Caller:
    """Calls a function with each stage and the share of it that is done; False cancels."""

    def __init__(self, function: Callable[[str, float | None], object]) -> None:
        self._function = function
        self._totals: dict[str, int | None] = {}

    def started(self, stage: str, total: int | None, unit: str) -> None:
        self._totals[stage] = total
        self.advanced(stage, 0)

    def advanced(self, stage: str, done: int) -> None:
        total = self._totals[stage]
        answer = self._function(stage, min(done / total, 1.0) if total else None)
        if answer is not None and not answer:  # `np.False_` is not `False`
            raise CancelledError(f"cancelled while {stage} was running")

    def finished(self, stage: str, seconds: float) -> None:
        pass


Progress = ProgressSink | Callable[[str, float | None], object] | bool | None
"""What functions take as `progress`: a listener, a function, True for a `ProgressBar`, or nothing.

A function is called with the name of each stage and the share of it that is done, or None if that
is not known. If it returns False, the work ends with a `CancelledError`; if it raises an error, the
work ends with that error.
"""


def _sink_of(progress: Progress) -> ProgressSink | None:
    if progress is True:
        return ProgressBar()
    if not progress:
        return None
    if isinstance(progress, ProgressSink):
        return progress
    if not callable(progress):
        raise OptionError(f"progress: {quoted(progress)} is not a function, True or None")
    return _Caller(progress)


@dataclass(frozen=True)
class StageRecord:
    """Time of one stage, and peak resident memory of the process up to its end, if known."""

    name: str
    seconds: float
    peak_memory_bytes: int | None


class ProcessTimes:
    """Seconds of each innermost stage since the process began, and of "start" and "other work"."""

    def __init__(self) -> None:
        self.start = time.perf_counter() - process_age()
        self.seconds: dict[str, float] = {}
        self._counted = self.start
        self._open = ["start"]

    def enter(self, name: str) -> None:
        """Begin a stage."""
        self._count()
        self._open.append(name)
        self.seconds.setdefault(name, 0.0)

    def leave(self) -> None:
        """End the stage that began last."""
        self._count()
        self._open.pop()
        if self._open == ["start"]:
            self._open = ["other work"]

    def end(self) -> dict[str, float]:
        """Return the seconds of all stages up to now, in the order in which they began."""
        self._count()
        return self.seconds

    def report(self) -> None:
        """Count what follows as "report"; the work is done."""
        self._count()
        self._open = ["report"]

    def _count(self) -> None:
        now, name = time.perf_counter(), self._open[-1]
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._counted
        self._counted = now


_TIMES: ContextVar[ProcessTimes | None] = ContextVar("process times", default=None)


@contextmanager
def process_times() -> Iterator[ProcessTimes]:
    """Let all stages of the block, in this thread, count for the times of the process."""
    token = _TIMES.set(times := ProcessTimes())
    try:
        yield times
    finally:
        _TIMES.reset(token)


class Stages:
    """The stages of one piece of work, in order.

    >>> stages = Stages()
    >>> with stages.stage("cast rays", total=100, unit="rays") as advance:
    ...     advance(100)
    >>> [record.name for record in stages.records]
    ['cast rays']
    """

    def __init__(self, sink: Progress = None) -> None:
        self._records: dict[str, StageRecord] = {}
        self._sink = _sink_of(sink)

    @property
    def records(self) -> list[StageRecord]:
        """Records of the stages so far, in the order in which they first began."""
        return list(self._records.values())

    @contextmanager
    def stage(
        self, name: str, *, total: int | None = None, unit: str = "", recorded: bool = True
    ) -> Iterator[Callable[[int], None]]:
        """Report a block, recorded or by its parts; yields a function to call with units done."""
        done = 0

        def advance(n_units: int) -> None:
            nonlocal done
            done += n_units
            if self._sink is not None:
                self._sink.advanced(name, done)

        if self._sink is not None:
            self._sink.started(name, total, unit)
        start = time.perf_counter()
        try:
            with self._timed(name, recorded=recorded):
                yield advance
        finally:
            if self._sink is not None:
                self._sink.finished(name, time.perf_counter() - start)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Record the time of a block without reporting it; parts of one name are added up."""
        with self._timed(name):
            yield

    @contextmanager
    def _timed(self, name: str, *, recorded: bool = True) -> Iterator[None]:
        start, times = time.perf_counter(), _TIMES.get()
        if times is not None:
            times.enter(name)
        try:
            yield
        finally:
            if times is not None:
                times.leave()
            if recorded:
                before = self._records[name].seconds if name in self._records else 0.0
                seconds = before + time.perf_counter() - start
                self._records[name] = StageRecord(name, seconds, peak_memory_bytes())


def process_age() -> float:
    """Seconds since this process began; where the system does not report it, its processor time."""
    try:
        # The 22nd field, in ticks since the machine began; the second may hold spaces.
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace")
        ticks = int(fields.rpartition(")")[2].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError, IndexError, ValueError):
        return time.process_time()


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
