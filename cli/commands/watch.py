"""`texbake watch`: build again whenever a file changes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake import BuildOptions, TexbakeError

from ..options import build_options
from ..terminal import Terminal, complain, say, terminal_options
from ..types import FileOf
from .build import print_result, shown

if TYPE_CHECKING:
    from texbake.building.report import BuildResult


@click.command(
    epilog="""
    \b
    Example:
      texbake watch studio.toml
      texbake watch studio.toml --only hero --jobs 1
    """
)
@click.argument("pipeline", type=FileOf((".toml",)), metavar="PIPELINE.toml")
@build_options(without=("wait", "prune", "verify"))
@terminal_options
def watch(pipeline: Path, options: BuildOptions, terminal: Terminal) -> None:
    """Build again whenever a file changes, until Ctrl-C.

    Checks the pipeline file, and every file that it reads, twice a second.
    """
    from texbake.building.build import watch as watch_pipeline

    def built(result: BuildResult | TexbakeError) -> None:
        if isinstance(result, TexbakeError):
            complain(str(result))
        else:
            print_result(result, terminal)
        if not terminal.quiet:
            say("watching ...")

    with shown(terminal) as listener:
        watch_pipeline(pipeline, options, listener=listener, built=built)
