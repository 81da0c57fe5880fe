"""`texbake remap`: other maps from a trace that was kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.baking.map_names import MAP_NAMES
from texbake.baking.options import (
    CONVENTIONS,
    FILLS,
    SHADINGS,
    SPACES,
    VERTEX_COLORS,
)

from ..map_options import FORMATS, HITS_SUFFIXES, name_pattern_option
from ..options import Decorator, output_folder, report_option, threads_option
from ..terminal import Terminal, terminal_options
from ..types import FileOf, Names


def _change(flag: str, kind: Any, metavar: str | None, text: str) -> Decorator[Any]:
    """Add an option that changes one of the bake's, where it is given."""
    return click.option(flag, type=kind, metavar=metavar, help=text)


@click.command(
    epilog="""
    \b
    Example:
      texbake remap scan.npz -o maps --maps curvature,position --format exr
      texbake remap scan.npz -o directx --maps normal --convention directx --bits 8
    """
)
@click.argument("hits", type=FileOf(HITS_SUFFIXES))
@output_folder("Folder of the maps; made if missing.", required=True)
@_change("--maps", Names(MAP_NAMES), None, f"Which, of {', '.join(MAP_NAMES)}.")
@click.option(
    "--format", "suffix", type=click.Choice(FORMATS), help="Kind of file.  [default: png]"
)
@_change("--space", click.Choice(SPACES), None, "Space of the normals.")
@_change("--convention", click.Choice(CONVENTIONS), None, "Green channel: +Y up or down.")
@_change("--bits", int, "8|16|32", "Bits a channel; 32 is float.")
@_change("--mid", float, "M", "Value of height 0 in an integer file, in [0, 1].")
@_change("--scale", float, "S", "Height that a change of 1 in an integer file stands for.")
@_change("--curvature-scale", float, "K", "Curvature that is white in integer files.")
@_change("--thickness-distance", float, "D", "Thickness that is white in integer files.")
@_change("--vertex-colors", click.Choice(VERTEX_COLORS), None, "What vertex colors are.")
@_change("--high-shading", click.Choice(SHADINGS), None, "Normals of the dense mesh.")
@_change("--padding", int, "PX", "Texels around each chart that repeat its edge.")
@_change("--fill", click.Choice(FILLS), None, "What fills the rest of a map.")
@name_pattern_option
@report_option
@threads_option
@terminal_options
def remap(
    hits: Path,
    output: Path,
    suffix: str | None,
    name_pattern: str,
    report: Path | None,
    terminal: Terminal,
    **changes: Any,
) -> None:
    """Make other maps from a trace that was kept.

    HITS is what texbake bake --hits has written. Neither mesh is needed, and no ray is cast; what
    is not given stays as it was in that bake. The maps are the same, byte for byte, as a bake's.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    with terminal.progress() as progress:
        done = texbake.remap_files(
            hits,
            output,
            given,
            format=suffix,
            name_pattern=name_pattern,
            report=report,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
