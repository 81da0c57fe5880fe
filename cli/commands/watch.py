"""`texbake watch`: build again whatever is saved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake.building.options import BuildOptions

from ..build_options import build_options
from ..building import shown, tell_result
from ..terminal import Terminal, say, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake.building.report import BuildResult
    from texbake.errors import TexbakeError


@click.command(
    epilog="""
    \b
    Example:
      texbake watch studio.toml
      texbake watch studio.toml --only hero --jobs 1
    """
)
@click.argument("pipeline", type=FileOf((".toml",)), metavar="PIPELINE.toml")
@build_options
@terminal_options
def watch(pipeline: Path, options: BuildOptions, terminal: Terminal) -> None:
    """Build again whatever is saved, until Ctrl-C.

    Looks at the pipeline file and at every file that it reads twice a second.
    """
    from texbake.building.watch import watch as run_watch
    from texbake.errors import TexbakeError

    def built(result: BuildResult | TexbakeError) -> None:
        if isinstance(result, TexbakeError):
            click.echo(f"texbake: {result}", err=True)
        else:
            tell_result(result, terminal)
        if not terminal.quiet:
            say("watching ...")

    with shown(terminal) as listener:
        run_watch(pipeline, options, listener=listener, built=built)
