"""Progress bars on a terminal: a bar for each running stage, a line for each finished one."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from .messages import printable
from .progress_lines import TimedStage


class Bars:
    """A `ProgressSink` that draws progress bars.

    A finished stage leaves one line with its time, so only running stages have bars, and the bars
    fit on any terminal.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._progress = Progress(
            SpinnerColumn("line"),
            TextColumn("{task.description:<24}", markup=False),
            BarColumn(bar_width=28),
            RateColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console or Console(stderr=True),
            transient=True,
        )
        self._tasks: dict[str, TaskID] = {}
        self._timed: dict[str, TimedStage] = {}

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def started(self, stage: str, total: int | None, unit: str) -> None:
        """Draw a bar, or a pulsing one if the amount of work is unknown."""
        self._tasks[stage] = self._progress.add_task(printable(stage), total=total, unit=unit)
        self._timed[stage] = TimedStage(stage, total, time.perf_counter())

    def advanced(self, stage: str, done: int) -> None:
        """Move a bar; announce a stage of more than a minute."""
        self._progress.update(self._tasks[stage], completed=done)
        timed = self._timed[stage]
        timed.done = done
        text = timed.announcement(time.perf_counter())
        if text is not None:
            self._print(f"  {text}")

    def finished(self, stage: str, seconds: float) -> None:
        """Replace the bar with a line."""
        task_id = self._tasks.pop(stage)
        del self._timed[stage]
        task = next(task for task in self._progress.tasks if task.id == task_id)
        self._progress.remove_task(task_id)
        line = f"  {stage:<24} {seconds:7.2f} s"
        if task.completed and seconds > 0:
            line += f"   {rate_text(task.completed / seconds, task.fields['unit'])}"
        self._progress.refresh()  # redraws the remaining bars below the line
        self._print(line)

    def _print(self, line: str) -> None:
        self._progress.console.print(
            printable(line), style="dim", markup=False, highlight=False, soft_wrap=True
        )


class RateColumn(ProgressColumn):
    """Units per second, such as `4.1 M rays/s`."""

    def render(self, task: Task) -> Text:
        """Return the rate since the stage began, or an empty text before the first count."""
        if not task.completed or not task.elapsed:
            return Text("")
        return Text(rate_text(task.completed / task.elapsed, task.fields["unit"]))


def rate_text(rate: float, unit: str) -> str:
    """Format units per second with at most three digits.

    >>> rate_text(4_130_000.0, "rays")
    '4.1 M rays/s'
    """
    prefix = ""
    for prefix in "", "k", "M", "G":
        if rate < 999.5 or prefix == "G":
            break
        rate /= 1000
    number = f"{rate:.1f}" if rate < 9.95 else f"{rate:.0f}"
    return f"{number} {prefix}{' ' if prefix and unit else ''}{unit}/s"
