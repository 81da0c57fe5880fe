"""`texbake bake`: one trace, all maps; or the light of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from texbake.baking.map_names import MAP_NAMES
from texbake.baking.options import BakeOptions

from ..baking import bake_light_maps, bake_one, bake_parts
from ..html import html_option
from ..map_options import FORMATS, source_options
from ..options import MESH_SUFFIXES, bake_options, height_options, output_folder, secondary_options
from ..parts_options import parts_options, taken
from ..terminal import Terminal, terminal_options
from ..types import FileOf, Names

LIGHT_MAP = "lightmap"
SCENE_SUFFIXES = (".toml", ".glb", ".gltf")
# What a bake of light maps takes.
_OF_LIGHT = {"scene", "output", "maps", "suffix", "size", "samples", "bits", "padding", "fill",
             "threads", "quiet", "kind"}  # fmt: skip


@click.command(
    epilog="""
    \b
    Example:
      texbake bake scan.ply low.obj -o maps --maps normal,displacement --size 2048
      texbake bake scan.ply low.obj -o maps --maps normal --cage cage.obj --fail-on-miss 0.5
      texbake bake high.glb low.glb -o maps --match-by-name --dry-run
      texbake bake --scene room.toml -o maps --maps lightmap --size 512 --samples 16
    """
)
@click.argument("high", type=FileOf(MESH_SUFFIXES), required=False)
@click.argument("low", type=FileOf(MESH_SUFFIXES), required=False)
@output_folder(
    "Folder of the maps, which are named as they are called; made if missing.", required=True
)
@click.option(
    "--maps",
    type=Names((*MAP_NAMES, LIGHT_MAP)),
    default=",".join(BakeOptions.maps),
    show_default=True,
    help=f"Which, of {', '.join(MAP_NAMES)}; or {LIGHT_MAP}, alone.",
)
@click.option(
    "--scene",
    type=FileOf(SCENE_SUFFIXES),
    metavar="SCENE",
    help=f"In place of HIGH and LOW, for --maps {LIGHT_MAP}: bake its static lights.",
)
@click.option(
    "--format",
    "suffix",
    type=click.Choice(FORMATS),
    help="Kind of file; exr and tif hold heights and light as they are.  "
    f"[default: png, and exr for {LIGHT_MAP}]",
)
@bake_options
@height_options
@source_options
@secondary_options
@parts_options
@html_option
@terminal_options
@click.pass_context
def bake(
    context: click.Context,
    /,
    high: Path | None,
    low: Path | None,
    output: Path,
    maps: tuple[str, ...],
    scene: Path | None,
    suffix: str | None,
    name_pattern: str,
    terminal: Terminal,
    **options: Any,
) -> None:
    """Bake several maps with one trace, or light maps.

    HIGH is the dense mesh, LOW the light one; of a scene its light maps are baked.

    A light map holds the ambient light and the static lights of a scene with their shadows, for
    each of its objects that has texture coordinates; it is named as the object.
    """
    if scene is not None or LIGHT_MAP in maps:
        _check_light(context, scene, maps)
        assert scene is not None
        of_light = {name: options[name] for name in _OF_LIGHT & options.keys()}
        bake_light_maps(scene, output, terminal, format=suffix or "exr", **of_light)
        return
    asked = taken(context, high, low, name_pattern, options)
    options |= {"maps": maps, "format": suffix, "name_pattern": name_pattern}
    if asked.is_plain:
        bake_one(asked.high[0], asked.low[0], output, terminal, **options)
    else:
        bake_parts(asked, output, terminal, **options)


def _check_light(context: click.Context, scene: Path | None, maps: tuple[str, ...]) -> None:
    """Refuse what a bake of light maps does not take, instead of leaving it out."""
    if scene is None:
        raise click.UsageError(f"--maps {LIGHT_MAP} needs a scene: give --scene SCENE", context)
    if maps != (LIGHT_MAP,):
        raise click.UsageError(f"--scene is for --maps {LIGHT_MAP}, alone", context)
    for parameter in context.command.params:
        name = parameter.name or ""
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and name not in _OF_LIGHT:
            called = parameter.opts[0] if isinstance(parameter, click.Option) else name.upper()
            raise click.UsageError(f"--maps {LIGHT_MAP} does not take {called}", context)
