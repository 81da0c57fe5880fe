"""`texbake transform`: scale, turn and move a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import TransformOptions

from ..moving import moved
from ..options import WRITABLE_MESH_SUFFIXES, mesh_argument, options_of, output_file
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake transform low.obj -o low.obj --scale 0.1
      texbake transform scan.ply -o scan.ply --up z --move 0,0.5,0
      texbake transform inside_out.stl -o turned.stl --flip
    """
)
@mesh_argument("mesh")
@output_file("The mesh; it may replace MESH.", WRITABLE_MESH_SUFFIXES)
@options_of(TransformOptions)
@terminal_options
def transform(mesh: Path, output: Path, terminal: Terminal, **options: Any) -> None:
    """Scale, rotate and move MESH, or flip its faces.

    The mesh is scaled and turned upright, then rotated about the origin, then moved.
    """
    moved(mesh, output, texbake.TransformOptions(**options), terminal)
