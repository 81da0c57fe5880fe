"""Live progress on a terminal: bars of stages, and the table of a build."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.live import Live
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
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from .messages import printable
from .progress import ShownProgress, TimedStage

if TYPE_CHECKING:
    from texbake.building.schedule import BuildEvent


class Bars(ShownProgress):
    """Draws progress bars of running stages; a finished stage leaves one line with its time."""

    def __init__(self, console: Console | None = None) -> None:
        super().__init__()
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

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def show(self, event: str, stage: TimedStage, seconds: float) -> None:
        """Draw, move or remove a bar; announce a stage of more than a minute."""
        if event == "started":  # the bar pulses if the amount of work is unknown
            name = printable(stage.name)
            task = self._progress.add_task(name, total=stage.total, unit=stage.unit)
            self._tasks[stage.name] = task
        elif event == "advanced":
            self._progress.update(self._tasks[stage.name], completed=stage.done)
            text = stage.announcement(self.clock())
            if text is not None:
                _print(self._progress.console, f"  {text}", "dim")
        else:
            self._progress.remove_task(self._tasks.pop(stage.name))
            line = f"  {stage.name:<24} {seconds:7.2f} s"
            if stage.done and seconds > 0:
                line += f"   {rate_text(stage.done / seconds, stage.unit)}"
            self._progress.refresh()  # redraws the remaining bars below the line
            _print(self._progress.console, line, "dim")


def _print(console: Console, line: str, style: str) -> None:
    """Print a line above the live display."""
    console.print(printable(line), style=style, markup=False, highlight=False, soft_wrap=True)


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


class BuildTable:
    """A table of the running steps and of the progress of the whole build."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._running: dict[tuple[str, str], float] = {}
        self._counts: dict[str, int] = {}
        self._done, self._total = 0, 1
        self._left: float | None = None
        self._left_at = 0.0
        self._live = Live(
            console=self._console, get_renderable=self._table, refresh_per_second=4, transient=True
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def add(self, event: BuildEvent) -> None:
        """Show an event."""
        if event.event == "note" and event.message:
            _print(self._console, event.message, "yellow")
        if event.total:
            self._done, self._total = event.done, event.total
        if event.seconds_left is not None:
            self._left, self._left_at = event.seconds_left, time.perf_counter()
        if event.state is None or event.asset is None or event.step is None:
            return
        step = event.asset, event.step
        if event.state == "running":
            self._running[step] = time.perf_counter()
            return
        self._running.pop(step, None)
        self._counts[event.state] = self._counts.get(event.state, 0) + 1
        if event.state == "failed":
            _print(self._console, f"{event.asset}: {event.step}: {event.message}", "red")

    def _table(self) -> Table:
        now = time.perf_counter()
        table = Table.grid(padding=(0, 2))
        shown = list(self._running.items())[: max(4, self._console.height - 4)]
        for (asset, step), start in shown:
            table.add_row(Text(printable(asset), overflow="ellipsis"), step, f"{now - start:.1f} s")
        counts = ", ".join(f"{n:,} {state}" for state, n in sorted(self._counts.items()))
        left = "" if self._left is None else _left(self._left - (now - self._left_at))
        table.add_row(
            ProgressBar(total=self._total, completed=self._done, width=28),
            f"{self._done:,} of {self._total:,} steps",
            left,
            Text(counts, style="dim"),
        )
        return table


def _left(seconds: float) -> str:
    """Format the remaining time.

    >>> _left(75.0)
    '1:15 left'
    """
    minutes, rest = divmod(max(round(seconds), 0), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d} left" if hours else f"{minutes}:{rest:02d} left"
