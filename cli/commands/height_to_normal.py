"""`texbake height-to-normal`: convert a height map to a normal map."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake import (
    BakeOptions,
    HeightToNormalOptions,
)

from ..options import (
    IMAGE_SUFFIXES,
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
      texbake height-to-normal bricks.png -o bricks_normal.png --scale 0.02
      texbake height-to-normal displacement.exr -o normal.png --width 3.5 --wrap clamp
    """
)
@click.argument("height", type=FileOf(IMAGE_SUFFIXES))
@output_file("The normal map, in tangent space.", (".png", ".exr", ".tif", ".tiff", ".tga"))
@options_of(HeightToNormalOptions)
@options_of(BakeOptions, "convention", "bits")
@threads_option
@terminal_options
def height_to_normal(
    height: Path,
    output: Path,
    scale: float | None,
    width: float,
    wrap: str,
    derivative: str,
    convention: str,
    bits: int | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Make a normal map from the heights in HEIGHT.

    Heights are read from the first channel. The file of a map that texbake baked contains the scale
    of its heights in model units; give the width of the image in model units then.
    """
    options = HeightToNormalOptions(scale=scale, width=width, wrap=wrap, derivative=derivative)
    done = texbake.height_to_normal_file(
        height, output, options, convention=convention, bits=bits, threads=threads
    )
    made = done.report
    terminal.summary(
        [
            ("size", f"{made.width} x {made.height}"),
            ("scale", f"{made.scale:.6g}, width {width:g}"),
        ]
    )
    terminal.wrote(done.files)
