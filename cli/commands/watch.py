"""`texbake watch`: build again whenever a file changes."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake import BuildOptions

from ..building import print_result, shown
from ..options import build_options
from ..terminal import Terminal, complain, say, terminal_options
from ..types import FileOf


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

    def built(result: texbake.BuildResult | texbake.TexbakeError) -> None:
        if isinstance(result, texbake.TexbakeError):
            complain(str(result))
        else:
            print_result(result, terminal)
        if not terminal.quiet:
            say("watching ...")

    with shown(terminal) as listener:
        texbake.watch(pipeline, options, listener=listener, built=built)
