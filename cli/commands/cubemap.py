"""`texbake cubemap`: convert latitude-longitude images to cube maps and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    CubeOptions,
)

from ..options import (
    IMAGE_SUFFIXES,
    options_of,
    output_option,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake cubemap studio.hdr -o faces/
      texbake cubemap studio.hdr -o cross.exr --size 512
      texbake cubemap faces/ -o pano.hdr
      texbake cubemap skybox/ -o sky.png --convention inside
    """
)
@click.argument("source", type=FileOf(IMAGE_SUFFIXES))
@output_option(
    FileOf(IMAGE_SUFFIXES),
    "DIR|FILE",
    "A folder for six faces, made if it is missing, or one image.",
    required=True,
)
@options_of(CubeOptions)
@threads_option
@terminal_options
def cubemap(
    source: Path, output: Path, threads: int | None, terminal: Terminal, **choices: Any
) -> None:
    """Convert SOURCE to a cube map, or from one.

    SOURCE is a latitude-longitude image (twice as wide as high, its middle along -z), a cross of
    4 x 3 faces, or a folder with the files px, nx, py, ny, pz and nz. Each output texel is the mean
    of the area that it covers.
    """
    options = CubeOptions(**choices)
    with terminal.progress():
        done = texbake.cubemap_files(source, output, options, threads=threads)
    for warning in done.warnings:
        terminal.warn(warning)
    made = done.report
    terminal.summary([("from", made.source_layout), ("to", f"{made.layout} of {made.size:,} px")])
    terminal.wrote(done.files)
