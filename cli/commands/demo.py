"""`texbake demo`: run the whole workflow on a generated orange."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake.jobs.options import DEMO_FOLDER, DemoOptions

from ..messages import command_line
from ..options import html_option, options_of, output_folder
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake demo
      texbake demo -o orange --triangles 4000000
      texbake demo --html orange.html
    """
)
@output_folder(
    "Folder for the files, which is made if it is missing.", default=DEMO_FOLDER, show_default=True
)
@options_of(DemoOptions)
@html_option
@terminal_options
def demo(output: Path, html: Path | None, terminal: Terminal, **choices: Any) -> None:
    """Do the whole job on an orange that is made by code.

    Also writes the high-poly mesh, orange_high.ply, to try other commands on. The page of --html
    also has plots of how right a photograph, a bump map, a normal map and a displacement map stay
    while the light and the viewer turn.
    """
    options = DemoOptions(**choices)
    from texbake.jobs.demo import demo as run_demo

    with terminal.progress() as progress:
        result = run_demo(output, options, html=html, command=command_line(), progress=progress)
    for warning in result.warnings:
        terminal.warn(warning)
    terminal.summary(result.table())
    terminal.wrote(result.files.values())
