"""`texbake remap`: make other maps from the hits of an earlier bake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    BakeOptions,
)

from ..bake_options import (
    HITS_SUFFIXES,
    format_option,
    name_pattern_option,
)
from ..options import (
    options_of,
    output_folder,
    report_option,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf

# Options of the bake that other maps of its hits can change.
_CHANGES = (
    *("maps", "space", "convention", "bits", "mid", "scale", "curvature_scale"),
    *("thickness_distance", "vertex_colors", "high_shading", "padding", "fill"),
)


@click.command(
    epilog="""
    \b
    Example:
      texbake remap scan.npz -o maps --maps curvature,position --format exr
      texbake remap scan.npz -o directx --maps normal --convention directx --bits 8
    """
)
@click.argument("hits", type=FileOf(HITS_SUFFIXES))
@output_folder("Folder of the maps, which is made if it is missing.", required=True)
@format_option
@options_of(BakeOptions, *_CHANGES, unset=True)
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
    """Make other maps from the hits of an earlier bake.

    HITS is a file written by texbake bake --hits. No meshes are needed and no rays are cast.
    Options that are not given keep their values from that bake. The maps are byte for byte those
    that a bake would write.
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
