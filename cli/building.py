"""The output of a build: its progress while it runs, and its results at the end."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from texbake.errors import counted

from .terminal import Terminal, complain

if TYPE_CHECKING:
    from texbake.building.progress import BuildEvent, BuildListener
    from texbake.building.report import BuildResult

_MOST_SHOWN = 20  # failures; of further ones only the number is printed


@contextmanager
def shown(terminal: Terminal) -> Iterator[BuildListener]:
    """Show a build as a live table on a terminal or as JSON lines; yield its listener."""
    if terminal.kind == "json" and not terminal.quiet:
        yield _print_json
    elif terminal.kind == "auto" and not terminal.quiet and sys.stderr.isatty():
        from .build_table import BuildTable

        with BuildTable() as table:
            yield table.add
    else:
        yield lambda event: _print_note(event, terminal)


def _print_json(event: BuildEvent) -> None:
    sys.stderr.write(json.dumps(event.to_json()) + "\n")
    sys.stderr.flush()


def _print_note(event: BuildEvent, terminal: Terminal) -> None:
    if event.event == "note" and event.message and not terminal.quiet:
        complain(event.message)


def print_result(result: BuildResult, terminal: Terminal) -> None:
    """Print the warnings, failures and figures of a build."""
    for asset in result.assets:
        for step in asset.steps:
            for note in step.notes:
                terminal.warn(f"{asset.name}: {step.step}: {note}")
    for asset in result.failed[:_MOST_SHOWN]:
        complain(f"{asset.name}: {asset.error}")
    if (n_more := len(result.failed) - _MOST_SHOWN) > 0:
        complain(f"{counted(n_more, 'more asset')} failed; build.json lists them")
    terminal.summary(result.table())
    terminal.wrote([result.folder / "build.json"])
