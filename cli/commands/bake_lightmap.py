"""`texbake bake-lightmap`: bake the lights of a scene into light maps of its objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake import BakeOptions, TextureBakeOptions

from ..bake_options import FORMATS
from ..baking import bake_light_maps
from ..options import SCENE_SUFFIXES, options_of, output_folder
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake bake-lightmap room.toml -o maps --size 512 --samples 16
    """
)
@click.argument("scene", type=FileOf(SCENE_SUFFIXES))
@output_folder("Folder of the maps, which is made if it is missing.", required=True)
@options_of(BakeOptions, "size")
@options_of(TextureBakeOptions, "samples", defaults={"samples": BakeOptions.samples})
@click.option(
    "--format",
    "suffix",
    type=click.Choice(FORMATS),
    default="exr",
    show_default=True,
    help="File format of the maps; exr and tif store light as floats.",
)
@click.option(
    "--set",
    "uv_set",
    metavar="NAME",
    help="Texture coordinates of the maps, for objects that have them; see: texbake unwrap --set. "
    " [default: the first]",
)
@options_of(BakeOptions, "bits", "padding", "fill", "threads")
@terminal_options
def bake_lightmap(
    scene: Path, output: Path, suffix: str, uv_set: str | None, terminal: Terminal, **choices: Any
) -> None:
    """Bake the static lights of SCENE into light maps.

    A light map contains the ambient light and the static lights with their shadows. Every object
    that has texture coordinates gets one, which has the object's name.
    """
    bake_light_maps(scene, output, terminal, format=suffix, uv_set=uv_set, **choices)
