"""`texbake bake`: one trace, all maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake.bake.map_names import MAP_NAMES
from texbake.bake.options import BakeOptions

from ..baking import bake_to_files
from ..options import bake_options, height_options, mesh_argument, output_folder
from ..terminal import Terminal, terminal_options
from ..types import Names

FORMATS = ("png", "exr", "tif", "tga")


@click.command(
    epilog="""
    \b
    Example:
      texbake bake scan.ply low.obj -o maps --maps normal,displacement --size 2048
      texbake bake scan.ply low.obj -o maps --maps normal --cage cage.obj --fail-on-miss 0.5
    """
)
@mesh_argument("high")
@mesh_argument("low")
@output_folder(
    "Folder of the maps, which are named as they are called; made if missing.", required=True
)
@click.option(
    "--maps",
    type=Names(MAP_NAMES),
    default=",".join(BakeOptions.maps),
    show_default=True,
    help=f"Which, of {', '.join(MAP_NAMES)}.",
)
@click.option(
    "--format",
    "suffix",
    type=click.Choice(FORMATS),
    default="png",
    show_default=True,
    help="Kind of file; exr and tif hold heights as they are.",
)
@bake_options
@height_options
@terminal_options
def bake(
    high: Path,
    low: Path,
    output: Path,
    maps: tuple[str, ...],
    suffix: str,
    terminal: Terminal,
    **options: Any,
) -> None:
    """Bake several maps of HIGH for LOW with one trace."""
    files = {name: output / f"{name}.{suffix}" for name in maps}
    bake_to_files(high, low, files, terminal, folder=output, **options)
