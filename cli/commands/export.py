"""`texbake export`: write an asset folder for another program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    ExportOptions,
    OptionError,
)

from ..options import (
    MESH_SUFFIXES,
    mesh_argument,
    options_of,
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
@output_folder("Folder for the files, which is made if it is missing.", required=True)
@options_of(ExportOptions, "to")
@click.option(
    "--maps",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder of maps, such as bake wrote: images whose names end in normal, ao, roughness, ...",
)
@click.option(
    "--map",
    "named",
    multiple=True,
    metavar="KIND=FILE",
    help="A map and its kind, in place of that in the folder; KIND:1002 is for UDIM tile 1002.",
)
@click.option(
    "--level",
    "levels",
    multiple=True,
    type=FileOf(MESH_SUFFIXES),
    metavar="MESH",
    help="A coarser level of detail, for a GLB file; repeatable, the finest first.",
)
@options_of(ExportOptions, without=("to", "threads"))
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

    Green channels, heights, packed channels, names and formats are converted to what the program
    reads. SETTINGS.txt in the folder says what to set where.
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
