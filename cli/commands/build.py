"""`texbake build`: build all assets of a pipeline."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import texbake
from texbake import BuildOptions

from ..building import print_result, shown
from ..messages import command_line
from ..options import build_options
from ..signals import FAILED
from ..terminal import Terminal, columns, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake.building.build import PlannedStep


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
