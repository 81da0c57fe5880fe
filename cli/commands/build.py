"""`texbake build`: build all assets of a pipeline."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

import texbake
from texbake import BuildOptions
from texbake.errors import counted

from ..messages import command_line
from ..options import build_options
from ..signals import FAILED
from ..terminal import Terminal, columns, complain, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake.building.build import PlannedStep
    from texbake.building.progress import BuildEvent, BuildListener
    from texbake.building.report import BuildResult

_MOST_SHOWN = 20  # failures; of further ones only the number is printed


@click.command(
    epilog="""
    \b
    Example:
      texbake build studio.toml
      texbake build studio.toml --plan
      texbake build studio.toml --jobs 8 --max-memory 24G
      texbake build studio.toml --only "orange*" --verify
      texbake build studio.toml --html build.html
      texbake build studio.toml --scheduler tcp://render-01:8786
    """
)
@click.argument("pipeline", type=FileOf((".toml",)), metavar="PIPELINE.toml")
@click.option("--plan", is_flag=True, help="Print what would run and why, and build nothing.")
@build_options()
@click.option(
    "--html",
    type=FileOf((".html",)),
    metavar="FILE.html",
    help="Also write a page of all assets: pictures, errors, times, and links to their own pages.",
)
@terminal_options
@click.pass_context
def build(
    ctx: click.Context,
    pipeline: Path,
    plan: bool,
    html: Path | None,
    options: BuildOptions,
    terminal: Terminal,
) -> None:
    """Build the assets of a pipeline file.

    Only what changed runs again. An asset that fails does not stop the others; build.json in the
    folder says how each one ended. Exits with 1 if any failed.
    """
    if plan:
        from texbake.building.build import plan_build

        _print_plan(plan_build(pipeline, options), terminal)
        return
    with shown(terminal) as listener:
        result = texbake.build(
            pipeline, options, html=html, command=command_line(), listener=listener
        )
    print_result(result, terminal)
    if html is not None:
        terminal.wrote([html])
    if not result.ok:
        ctx.exit(FAILED)


def _print_plan(steps: list[PlannedStep], terminal: Terminal) -> None:
    counts: dict[str, int] = {}
    for step in steps:
        counts[step.state] = counts.get(step.state, 0) + 1
    rows = [("asset", "step", "", "why")]
    rows += [(s.asset, s.step, s.state, s.why) for s in steps if s.state != "current" or s.why]
    if len(rows) > 1:
        columns(rows)
    terminal.summary([("steps", ", ".join(f"{n:,} {state}" for state, n in counts.items()))])


@contextmanager
def shown(terminal: Terminal) -> Iterator[BuildListener]:
    """Show a build as a live table on a terminal or as JSON lines; yield its listener."""
    if terminal.kind == "json" and not terminal.quiet:
        yield _print_json
    elif terminal.kind == "auto" and not terminal.quiet and sys.stderr.isatty():
        from ..build_table import BuildTable

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
