"""What a build shows while it runs, and what it says in the end."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from .terminal import Terminal

if TYPE_CHECKING:
    from texbake.building.progress import BuildEvent, Listener
    from texbake.building.report import BuildResult

_MOST_TOLD = 20  # failures, before only their number is told


@contextmanager
def shown(terminal: Terminal) -> Iterator[Listener]:
    """Show a build: a live table on a terminal, or JSON lines; yields what listens to it."""
    if terminal.kind == "json" and not terminal.quiet:
        yield _json_line
    elif terminal.kind == "auto" and not terminal.quiet and sys.stderr.isatty():
        from .build_table import BuildTable

        with BuildTable() as table:
            yield table.told
    else:
        yield lambda event: _note(event, terminal)


def _json_line(event: BuildEvent) -> None:
    sys.stderr.write(json.dumps(event.to_json()) + "\n")
    sys.stderr.flush()


def _note(event: BuildEvent, terminal: Terminal) -> None:
    if event.event == "note" and event.message and not terminal.quiet:
        click.echo(f"texbake: {event.message}", err=True)


def tell_result(result: BuildResult, terminal: Terminal) -> None:
    """Print what failed, what was met, and the figures."""
    for asset in result.assets:
        for step in asset.steps:
            for note in step.notes:
                terminal.warn(f"{asset.name}: {step.step}: {note}")
    for asset in result.failed[:_MOST_TOLD]:
        click.echo(f"texbake: {asset.name}: {asset.error}", err=True)
    if (n_more := len(result.failed) - _MOST_TOLD) > 0:
        click.echo(f"texbake: {n_more:,} more assets failed; build.json has them", err=True)
    terminal.summary(result.table())
    terminal.wrote([result.folder / "build.json"])
