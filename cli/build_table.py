"""The live table of a build: a line for each running step, and one for the whole build."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from .messages import printable

if TYPE_CHECKING:
    from texbake.building.progress import BuildEvent


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
            console=self._console,
            get_renderable=self._table,
            refresh_per_second=4,
            transient=True,
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._live.stop()

    def add(self, event: BuildEvent) -> None:
        """Show an event."""
        if event.event == "note" and event.message:
            self._print(event.message, "yellow")
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
            self._print(f"{event.asset}: {event.step}: {event.message}", "red")

    def _print(self, text: str, style: str) -> None:
        self._console.print(
            printable(text), style=style, markup=False, highlight=False, soft_wrap=True
        )

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
