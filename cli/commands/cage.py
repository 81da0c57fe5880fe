"""`texbake cage`: a cage measured from the two meshes."""

from __future__ import annotations

from pathlib import Path

import click

from texbake.jobs.outputs import check_distinct, check_mesh

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
    help="Model units added everywhere.  [default: 0.0001 of the size of both meshes]",
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
    """Fit a cage around HIGH, made from LOW.

    It has the faces and texture coordinates of LOW. No part of HIGH lies outside it, and it reaches
    no farther than it must: no vertex could go in by itself. For --cage, and for any other program
    that takes cages.
    """
    check_distinct([output], [high, low])
    check_mesh(output)
    import texbake

    with terminal.progress() as progress:
        fitted = texbake.fit_cage(
            texbake.read_mesh(high, progress=progress),
            texbake.read_mesh(low, progress=progress),
            margin=margin,
            threads=threads,
        )
        texbake.write_mesh(fitted.mesh, output)
    for warning in fitted.warnings:
        terminal.warn(warning)
    terminal.summary(fitted.table())
    terminal.wrote([output])
