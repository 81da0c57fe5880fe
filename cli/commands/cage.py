"""`texbake cage`: create a cage that fits the high-poly and the low-poly mesh."""

from __future__ import annotations

from pathlib import Path

import click

import texbake

from ..options import (
    WRITABLE_MESH_SUFFIXES,
    mesh_argument,
    output_file,
    threads_option,
)
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake cage scan.ply low.obj -o cage.obj
      texbake cage scan.ply low.obj -o cage.ply --margin 0.01
    """
)
@mesh_argument("high")
@mesh_argument("low")
@output_file("The cage.", WRITABLE_MESH_SUFFIXES)
@click.option(
    "--margin",
    type=float,
    metavar="LENGTH",
    help="Distance in model units that is added everywhere.  "
    "[default: 0.0001 of the size of both meshes]",
)
@threads_option
@terminal_options
def cage(
    high: Path,
    low: Path,
    output: Path,
    margin: float | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Fit a cage around HIGH, starting from LOW.

    The cage has the faces and texture coordinates of LOW, and no part of HIGH lies outside it. It
    is as tight as possible: no vertex could move farther in on its own. Use it with bake --cage,
    or in any other program that takes cages.
    """
    with terminal.progress() as progress:
        done = texbake.cage_file(
            high, low, output, margin=margin, threads=threads, progress=progress
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
