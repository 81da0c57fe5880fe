"""`texbake run`: simplify, unwrap, bake and render in one command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from texbake import RunOptions

from ..html import command_line
from ..options import html_option, mesh_argument, options_of, output_folder
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake run scan.ply -o asset --faces 500 --size 2048
      texbake run scan.ply -o asset --faces 2000 --quality best --convention directx
      texbake run scan.ply -o asset --error 0.5%
      texbake run scan.ply -o asset --faces 500 --max-error 0.5deg,0.01%
    """
)
@mesh_argument("high")
@output_folder("Folder for the files, which is made if it is missing.", required=True)
@options_of(RunOptions, without=("base_color",), defaults={"n_faces": None})
@html_option
@terminal_options
def run(high: Path, output: Path, html: Path | None, terminal: Terminal, **choices: Any) -> None:
    """Do the whole job: from HIGH to a finished asset.

    Simplifies, unwraps, bakes and compares: the asset is a low-poly mesh with maps. A mesh
    scan.ply gives scan_low.obj, scan_low.glb, scan_normal.png, scan_displacement.exr,
    scan_preview.png, scan_compare.png and scan_report.json.

    By default, maps have 2048 x 2048 texels with four rays each, as a finished asset needs.
    texbake bake casts a sixteenth as many by default, which is enough to try options.
    """
    options = RunOptions(**choices)
    from texbake.jobs.run import run_files

    with terminal.progress() as progress:
        result = run_files(
            high, output, options, html=html, command=command_line(), progress=progress
        )
    for warning in result.warnings:
        terminal.warn(warning)
    terminal.summary(result.table())
    terminal.wrote(result.files.values())
