"""`texbake unwrap`: create texture coordinates for a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import texbake
from texbake import (
    UnwrapOptions,
)

from ..mapping import SECTIONS, mapping_options
from ..measures import distortion_rows
from ..options import (
    MESH_SUFFIXES,
    output_option,
    report_option,
    threads_option,
)
from ..sections import SectionedCommand
from ..terminal import Terminal, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake import UnwrapReport


@click.command(
    cls=SectionedCommand,
    sections=SECTIONS,
    epilog="""
    \b
    Example:
      texbake unwrap low.obj -o low_uv.obj --size 2048 --padding 8
      texbake unwrap low.obj -o low_uv.glb --quality best --layout layout.png --heat
      texbake unwrap body.obj wheels.obj -o car --tiles 2 --texel-density 512
      texbake unwrap bottle.obj -o bottle_uv.obj --method cylindrical --caps --checker look.png
      texbake unwrap bunny.obj -o b.obj --method two-part --surface sphere --via object-normal
    """,
)
@click.argument(
    "meshes", nargs=-1, required=True, type=FileOf(MESH_SUFFIXES), metavar="MESH... [OUTPUT]"
)
@output_option(
    click.Path(path_type=Path),
    "FILE|DIR",
    "The mesh with texture coordinates, or a folder for several meshes.",
    after="meshes",
    required=True,
)
@mapping_options
@click.option(
    "--layout",
    type=FileOf((".png", ".svg")),
    metavar="FILE",
    help="Also draw the charts, as PNG or SVG.",
)
@click.option("--heat", is_flag=True, help="Color the layout by stretch.")
@click.option(
    "--checker",
    type=FileOf((".png",)),
    metavar="FILE.png",
    help="Also draw the mesh with a checker texture.",
)
@report_option
@threads_option
@terminal_options
def unwrap(
    meshes: tuple[Path, ...],
    output: Path,
    options: UnwrapOptions,
    layout: Path | None,
    heat: bool,
    checker: Path | None,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Give MESH texture coordinates.

    In an atlas no two faces overlap and none is mirrored. Positions and the order of faces stay as
    they are. Several meshes share one atlas.
    """
    with terminal.progress() as progress:
        done = texbake.unwrap_files(
            meshes,
            output,
            options,
            layout=layout,
            heat=heat,
            checker=checker,
            report=report,
            threads=threads,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    for figures in done.report:
        if len(done.report) > 1:
            terminal.summary([(figures.mesh, "")])
        terminal.summary(_rows(figures))
    terminal.wrote(done.files)


def _rows(report: UnwrapReport) -> list[tuple[str, str]]:
    tallies = [(name, f"{count:,}") for name, count in report.tallies.items()]
    if report.distortion is None:
        measured = [("stretch", "none to measure: no face has an area in the texture")]
    else:
        measured = distortion_rows(report.distortion)
    return [("faces", f"{report.n_faces:,}"), *measured, *tallies]
