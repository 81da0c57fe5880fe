"""`texbake demo`: the whole job on an orange made by code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.jobs.options import DEMO_FOLDER, DemoOptions

from ..options import number_option, output_folder, size_option, threads_option
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake demo
      texbake demo -o orange --triangles 4000000
    """
)
@output_folder("Folder for the files; made if missing.", default=DEMO_FOLDER, show_default=True)
@number_option(
    "--triangles", int, DemoOptions.triangles, "N", "Triangles of the dense mesh, about."
)
@number_option("--faces", int, DemoOptions.faces, "N", "Triangles of the light mesh.")
@size_option(DemoOptions.size, "Texels of the maps.")
@threads_option
@terminal_options
def demo(output: Path, terminal: Terminal, **choices: Any) -> None:
    """Do the whole job on an orange made by code.

    Writes the dense mesh as well, orange_high.ply, for other commands to be tried on.
    """
    options = DemoOptions(**choices)
    with terminal.progress() as progress:
        result = texbake.demo(output, options, progress=progress)
    for warning in result.warnings:
        terminal.warn(warning)
    terminal.summary(result.table())
    terminal.wrote(result.files.values())
