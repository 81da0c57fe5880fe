"""`texbake repair`: repair a mesh without moving its surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import RepairOptions

from ..options import WRITABLE_MESH_SUFFIXES, mesh_argument, options_of, output_file
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake repair scan.ply -o clean.ply
      texbake repair model.obj -o clean.obj --no-winding
    """
)
@mesh_argument("mesh")
@output_file("The repaired mesh; it may replace MESH.", WRITABLE_MESH_SUFFIXES)
@options_of(RepairOptions)
@terminal_options
def repair(mesh: Path, output: Path, terminal: Terminal, **options: Any) -> None:
    """Repair MESH without moving its surface.

    Prints what was changed. Holes, edges of more than two faces and parts that intersect stay;
    texbake check names them.
    """
    with terminal.progress() as progress:
        done = texbake.repair_file(mesh, output, RepairOptions(**options), progress=progress)
    counts = [(title, f"{count:,}") for title, count in done.report.counts.items()]
    terminal.summary([("faces", f"{done.report.n_faces:,}"), *counts])
    terminal.wrote(done.files)
