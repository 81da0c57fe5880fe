"""`texbake run`: the whole job."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.baking.options import CONVENTIONS
from texbake.jobs.options import RunOptions
from texbake.mesh.simplify_options import QUALITIES
from texbake.rendering.options import UPS

from ..html import command_line, html_option
from ..options import (
    choice_option,
    mesh_argument,
    number_option,
    output_folder,
    run_sample_options,
    size_option,
    threads_option,
    view_option,
)
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake run scan.ply -o asset --faces 500 --size 2048
      texbake run scan.ply -o asset --faces 2000 --quality best --convention directx
      texbake run scan.ply -o asset --faces 500 --max-error 0.5deg,0.01%
    """
)
@mesh_argument("high")
@output_folder("Folder for the files; made if missing.", required=True)
@click.option(
    "--faces", "n_faces", type=int, required=True, metavar="N", help="Triangles to reach."
)
@choice_option(
    "--quality", QUALITIES, RunOptions.quality, "How to make the mesh lighter: soon, or well."
)
@size_option(RunOptions.size, "Texels of the maps.")
@number_option(
    "--padding", int, RunOptions.padding, "PX", "Texels around each chart that repeat its edge."
)
@run_sample_options
@choice_option(
    "--convention",
    CONVENTIONS,
    RunOptions.convention,
    "Green channel of the normal map; that in the GLB is always opengl.",
)
@view_option
@choice_option("--up", UPS, RunOptions.up, "Axis of the world that is up in the pictures.")
@threads_option
@html_option
@terminal_options
def run(high: Path, output: Path, html: Path | None, terminal: Terminal, **choices: Any) -> None:
    """Do the whole job, from HIGH to a light mesh with maps.

    Simplifies, unwraps, bakes, and renders to compare. A mesh scan.ply gives scan_low.obj and
    scan_low.glb, scan_normal.png, scan_displacement.exr, scan_preview.png, scan_compare.png and
    scan_report.json.
    """
    options = RunOptions(**choices)
    with terminal.progress() as progress:
        result = texbake.run_files(
            high, output, options, html=html, command=command_line(), progress=progress
        )
    for warning in result.warnings:
        terminal.warn(warning)
    terminal.summary(result.table())
    terminal.wrote(result.files.values())
