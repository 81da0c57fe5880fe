"""`texbake compare`: compare a low-poly mesh and its maps with the high-poly mesh."""

from __future__ import annotations

from pathlib import Path

import click

import texbake

from ..messages import command_line
from ..options import (
    html_option,
    image_option,
    mesh_argument,
    output_option,
    picture_options,
    report_option,
    threads_option,
)
from ..terminal import Terminal, table, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake compare scan.ply low.obj --normal-map normal.png
      texbake compare scan.ply low.obj --normal-map normal.png --view 90,10 -o side.png
    """
)
@mesh_argument("high")
@mesh_argument("low")
@image_option("--normal-map", "Normal map of LOW.")
@image_option("--displacement", "Height map of LOW.")
@image_option("--albedo", "Color map of LOW.")
@output_option(
    FileOf((".png",)),
    "FILE",
    "The pictures side by side.  [default: LOW's name and _compare.png, in this folder]",
)
@picture_options
@report_option
@html_option
@threads_option
@terminal_options
def compare(
    high: Path,
    low: Path,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    output: Path | None,
    picture: texbake.RenderOptions,
    report: Path | None,
    html: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Measure how close LOW with its maps comes to HIGH.

    From six sides, prints the angle between the shading normals that pixels show, and the PSNR and
    SSIM of the pictures, for LOW with its maps and without them. Writes HIGH, LOW without maps, LOW
    with its maps, and the difference, side by side.
    """
    from texbake.jobs.comparison import compare_files, comparison_table

    with terminal.progress() as progress:
        done = compare_files(
            high,
            low,
            output,
            picture,
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            report=report,
            html=html,
            command=command_line(),
            threads=threads,
            progress=progress,
        )
    table(comparison_table(done.report))
    terminal.wrote(done.files)
