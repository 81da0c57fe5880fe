"""`texbake bake`: bake maps of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bake_options import (
    SECTIONS,
    bake_options,
    format_option,
    height_options,
    maps_option,
    parts_options,
    secondary_options,
    source_options,
    taken,
)
from ..baking import bake_one, bake_parts
from ..html import html_option
from ..options import (
    MESH_SUFFIXES,
    output_folder,
)
from ..sections import SectionedCommand
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    cls=SectionedCommand,
    sections=SECTIONS,
    epilog="""
    \b
    Example:
      texbake bake scan.ply low.obj -o maps --maps normal,displacement --size 2048
      texbake bake scan.ply low.obj -o maps --maps normal --cage cage.obj --fail-on-miss 0.5
      texbake bake high.glb low.glb -o maps --match-by-name --dry-run
    """,
)
@click.argument("high", type=FileOf(MESH_SUFFIXES), required=False)
@click.argument("low", type=FileOf(MESH_SUFFIXES), required=False)
@output_folder("Folder of the maps, which is made if it is missing.", required=True)
@maps_option
@format_option
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
    suffix: str | None,
    name_pattern: str,
    terminal: Terminal,
    **options: Any,
) -> None:
    """Bake one or several maps of HIGH for LOW.

    HIGH is the high-poly mesh, LOW the low-poly mesh that the maps are for. All maps are made
    with the same rays. LOW needs texture coordinates (texbake unwrap). Without --front, --back
    and --cage, ray distances are fitted at each vertex.
    """
    asked = taken(context, high, low, name_pattern, options)
    options |= {"maps": maps, "format": suffix, "name_pattern": name_pattern}
    if asked.is_plain(options):
        options["join_objects"] = asked.options.join_objects
        bake_one(asked.high[0], asked.low[0], output, terminal, **options)
    else:
        bake_parts(asked, output, terminal, **options)
