"""`texbake export`: an asset folder for another program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.errors import OptionError
from texbake.jobs.export.options import (
    CONVENTIONS,
    MESH_FORMATS,
    TARGETS,
    TEXTURES,
    UPS,
    ExportOptions,
)

from ..options import (
    MESH_SUFFIXES,
    choice_option,
    mesh_argument,
    number_option,
    output_folder,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake export low_uv.obj --to unreal --maps maps -o unreal
      texbake export low.glb --to unity --map normal=n.png --map roughness=r.png -o unity
      texbake export low.obj --to threejs --maps maps --level lod1.obj --compress -o web
    """
)
@mesh_argument("mesh")
@output_folder("Folder for the files; made if missing.", required=True)
@click.option(
    "--to", "target", type=click.Choice(TARGETS), required=True, help="The program it is for."
)
@click.option(
    "--maps",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder of maps, such as bake wrote: images whose names end in normal, ao, roughness ...",
)
@click.option(
    "--map",
    "named",
    multiple=True,
    metavar="KIND=FILE",
    help="One map by its kind; stands above the folder's. KIND:1002 is one of a UDIM tile.",
)
@click.option(
    "--level",
    "levels",
    multiple=True,
    type=FileOf(MESH_SUFFIXES),
    metavar="MESH",
    help="A coarser mesh for where the asset is small, in a GLB; the finest first.",
)
@click.option("--name", metavar="NAME", help="Name of the asset.  [default: that of MESH]")
@choice_option(
    "--mesh-format",
    MESH_FORMATS,
    ExportOptions.mesh_format,
    "Format of the mesh.  [default: what the program reads best]",
)
@choice_option(
    "--textures", TEXTURES, ExportOptions.textures, "Format of the textures; dds is for godot."
)
@choice_option("--up", UPS, ExportOptions.up, "Axis of MESH that is up.")
@number_option(
    "--meters-per-unit",
    float,
    ExportOptions.meters_per_unit,
    "M",
    "Meters of a model unit, such as 0.01 for centimeters.",
)
@choice_option(
    "--convention",
    CONVENTIONS,
    ExportOptions.convention,
    "Green channel of normal maps that do not say it themselves.",
)
@click.option(
    "--compress", is_flag=True, help="Code vertices and triangles of a GLB by meshoptimizer."
)
@click.option("--layers", is_flag=True, help="Also write all maps as layers of one EXR file.")
@threads_option
@terminal_options
def export(
    mesh: Path,
    output: Path,
    folder: Path | None,
    named: tuple[str, ...],
    levels: tuple[Path, ...],
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Write MESH and its maps for another program.

    Green channels, heights, packed channels, names and formats are made as the program reads them;
    SETTINGS.txt says what to set where. See docs/export.md.
    """
    options = ExportOptions(**choices)
    with terminal.progress() as progress:
        result = texbake.export_files(
            mesh,
            output,
            options,
            maps=folder,
            named_maps=_named_maps(named),
            levels=levels,
            progress=progress,
        )
    for warning in result.warnings:
        terminal.warn(warning)
    terminal.wrote(result.files)


def _named_maps(named: tuple[str, ...]) -> dict[str, Path]:
    """Return the files of `KIND=FILE`, by their kind."""
    maps: dict[str, Path] = {}
    for word in named:
        kind, equals, file = word.partition("=")
        if not (kind and equals and file):
            raise OptionError(f"map: {word!r} is not KIND=FILE, such as normal=n.png")
        if kind in maps:
            raise OptionError(f"map: {kind} is given twice; give each map once")
        maps[kind] = Path(file)
    return maps
