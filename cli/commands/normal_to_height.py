"""`texbake normal-to-height`: convert a normal map to a height map."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake import (
    NormalToHeightOptions,
)

from ..options import (
    IMAGE_SUFFIXES,
    bits_option,
    options_of,
    output_file,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake normal-to-height bricks_normal.png -o bricks.exr
      texbake normal-to-height normal.png -o height.png --method frankot-chellappa --wrap clamp
    """
)
@click.argument("normal", type=FileOf(IMAGE_SUFFIXES))
@output_file("The height map.", (".png", ".exr", ".tif", ".tiff", ".tga"))
@options_of(NormalToHeightOptions)
@bits_option
@threads_option
@terminal_options
def normal_to_height(
    normal: Path,
    output: Path,
    method: str,
    wrap: str,
    width: float,
    convention: str | None,
    bits: int | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Make a height map from the normals in NORMAL.

    NORMAL is a normal map in tangent space. The mean of the heights is 0, because normals do
    not determine it. The file contains the scale of the heights.
    """
    options = NormalToHeightOptions(method=method, wrap=wrap, width=width, convention=convention)
    done = texbake.normal_to_height_file(normal, output, options, bits=bits, threads=threads)
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
