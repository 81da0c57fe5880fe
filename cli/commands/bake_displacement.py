"""`texbake bake-displacement`: how far the dense mesh lies from the light one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..baking import bake_one
from ..html import html_option
from ..options import bake_options, height_options, mesh_argument, output_file
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake bake-displacement scan.ply low.obj -o height.exr --size 2048
      texbake bake-displacement scan.ply low.obj -o height.png --mid 0.5 --scale 0.2
    """
)
@mesh_argument("high")
@mesh_argument("low")
@output_file("The map: exr, tif or png.", (".exr", ".tif", ".png"))
@bake_options
@height_options
@html_option
@terminal_options
def bake_displacement(
    high: Path, low: Path, output: Path, terminal: Terminal, **options: Any
) -> None:
    """Bake the distance from LOW to HIGH into a map for LOW.

    Signed, in model units along LOW's smooth normals, positive outwards: moving a finely divided
    LOW by them gives HIGH back. Float files carry them as they are; others carry h with
    d = (h - mid) * scale, and both numbers in the file.
    """
    bake_one(high, low, {"displacement": output}, terminal, **options)
