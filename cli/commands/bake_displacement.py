"""`texbake bake-displacement`: bake the displacement of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bake_options import (
    bake_options,
    height_options,
)
from ..baking import bake_one
from ..html import html_option
from ..options import (
    mesh_argument,
    output_file,
)
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
@output_file("The displacement map: exr, tif or png.", (".exr", ".tif", ".png"))
@bake_options
@height_options
@html_option
@terminal_options
def bake_displacement(
    high: Path, low: Path, output: Path, terminal: Terminal, **options: Any
) -> None:
    """Bake a displacement map of HIGH for LOW.

    The map contains the signed distances from LOW to HIGH along the smooth normals of LOW, in
    model units, positive outwards. Moving a finely subdivided LOW by them gives HIGH. Float files
    contain the distances d themselves. Integer files contain h with d = (h - mid) * scale, and
    mid and scale are in their metadata.
    """
    bake_one(high, low, {"displacement": output}, terminal, **options)
