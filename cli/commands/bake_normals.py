"""`texbake bake-normals`: bake the normals of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bake_options import (
    bake_options,
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
      texbake bake-normals scan.ply low.obj -o normal.png --size 2048
      texbake bake-normals scan.ply low.obj -o normal.tga --convention directx --samples 4
    """
)
@mesh_argument("high")
@mesh_argument("low")
@output_file("The normal map: png, exr, tif or tga.", (".png", ".exr", ".tif", ".tga"))
@bake_options
@html_option
@terminal_options
def bake_normals(high: Path, low: Path, output: Path, terminal: Terminal, **options: Any) -> None:
    """Bake a normal map of HIGH for LOW.

    LOW needs texture coordinates (texbake unwrap). Without --front, --back and --cage, ray
    distances are fitted at each vertex; the summary and the report contain them.
    """
    bake_one(high, low, {"normal": output}, terminal, **options)
