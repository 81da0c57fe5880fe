"""Output of a command: progress on stderr, results on stdout."""

from __future__ import annotations

import functools
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import field
from typing import TYPE_CHECKING, Any

import click

from texbake import FileError
from texbake.progress import ProcessTimes, peak_memory_bytes, process_times
from texbake.records import dataclass

from .messages import in_line, printable, with_flags
from .progress import JsonLines, Lines, ShownProgress

if TYPE_CHECKING:
    from pathlib import Path

    from texbake.progress import Progress
    from texbake.sampling.rounds import BudgetClock

_HEADING = {"bold": True}
PROGRESS = ("auto", "json", "none")


@dataclass(frozen=True)
class Terminal:
    """The output of a command."""

    # `auto` (bars if stderr is a terminal, else a line every ten seconds), `json` (one object per
    # line on stderr) or `none`.
    kind: str = "auto"
    # Print no progress and no summary. Warnings and errors are still printed.
    quiet: bool = False
    # Print how long each stage took.
    verbose: bool = False
    # Seconds of each stage of this process.
    times: ProcessTimes = field(default_factory=ProcessTimes)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Show the progress of the work in the block; yield None if no progress is shown."""
        with self._shown_progress() as sink:
            yield sink
        self.times.report()

    def _shown_progress(self) -> AbstractContextManager[ShownProgress | None]:
        if self.quiet or self.kind == "none":
            return nullcontext(None)
        if self.kind == "json":
            return nullcontext(JsonLines(sys.stderr))
        if sys.stderr.isatty():
            from .live import Bars

            return Bars()
        return Lines(_progress_line)

    def summary(self, rows: Sequence[tuple[str, str]]) -> None:
        """Print a table, unless `--quiet` is given."""
        if not self.quiet:
            table(rows)

    def print_times(self) -> None:
        """Print how long each stage took, and their sum, the age of the process, if asked to."""
        if self.verbose:
            peak, stages = peak_memory_bytes(), self.times.end()
            memory = "" if peak is None else f", peak memory {peak / 1e9:.2f} GB"
            rows = [(f"  {name}", f"{seconds:.2f} s") for name, seconds in stages.items()]
            table([("Stages", ""), *rows, ("  total", f"{sum(stages.values()):.2f} s{memory}")])

    def wrote(self, paths: Iterable[Path]) -> None:
        """Print the paths of the files written."""
        if not self.quiet:
            for path in paths:
                say(f"wrote {in_line(str(path))}")

    def clock(self) -> BudgetClock:
        """Return the clock of a time budget, which began with the process."""
        from texbake.sampling.rounds import BudgetClock

        return BudgetClock.of_process(self.warn)

    def warn(self, text: str) -> None:
        """Print a warning on stderr."""
        complain(f"warning: {with_flags(text)}")


def complain(text: str) -> None:
    """Print a line on stderr, with control characters as escapes."""
    click.echo(f"texbake: {printable(text)}", err=True)


def _progress_line(text: str) -> None:
    """Print on stderr; progress that cannot be printed does not stop the work."""
    with suppress(OSError):
        complain(text)


def say(text: str, **style: Any) -> None:
    """Print on stdout, control characters as escapes; raise `FileError` if that fails."""
    try:
        click.echo(click.style(printable(text), **style) if style else printable(text))
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        raise
    except OSError as error:
        raise FileError(f"standard output: cannot be written: {error.strerror}") from error


def table(rows: Sequence[Sequence[str]]) -> None:
    """Print labels and aligned values on stdout; a row without a value is a heading."""
    rows = [(in_line(label), in_line(value)) for label, value in rows]
    width = max((len(label) for label, value in rows if value), default=0)
    for label, value in rows:
        if value:
            say(f"{label:<{width}}  {with_flags(value)}")
        else:
            say(label, **_HEADING)


def columns(rows: Sequence[Sequence[str]], *, numbers: int = 0) -> None:
    """Print aligned rows with a heading, the last `numbers` columns to the right, cut to fit."""
    rows = [[in_line(cell) for cell in row] for row in rows]
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    if sys.stdout is not None and sys.stdout.isatty():
        room = shutil.get_terminal_size().columns - 2 * (len(widths) - 1)
        widest = widths.index(max(widths))
        least = min(24, widths[widest])
        widths[widest] = max(least, widths[widest] - max(0, sum(widths) - room))
    for i, row in enumerate(rows):
        cells = [
            cell.rjust(width) if k >= len(row) - numbers else _cut(cell, width).ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        say("  ".join(cells).rstrip(), **_HEADING if i == 0 else {})


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "…"


def terminal_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add `--quiet`, `--verbose` and `--progress`; the command receives them as `terminal`."""

    @click.option("-q", "--quiet", is_flag=True, help="Print no progress and no summary.")
    @click.option("-v", "--verbose", is_flag=True, help="Also print how long each stage took.")
    @click.option(
        "--progress",
        type=click.Choice(PROGRESS),
        default="auto",
        show_default=True,
        help="Show bars if stderr is a terminal, else a line every ten seconds (auto), or print "
        "one JSON object per line on stderr (json).",
    )
    @functools.wraps(command)
    def with_terminal(
        *args: Any, progress: str, quiet: bool, verbose: bool, **options: Any
    ) -> None:
        with process_times() as times:
            terminal = Terminal(progress, quiet, verbose, times)
            command(*args, terminal=terminal, **options)
        terminal.print_times()

    return with_terminal
