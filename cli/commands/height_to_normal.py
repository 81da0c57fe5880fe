"""`texbake height-to-normal`: heights to normals."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake.baking.options import CONVENTIONS, BakeOptions
from texbake.texture.height_options import (
    DEFAULT_SCALE,
    DERIVATIVES,
    WRAPS,
    HeightToNormalOptions,
)

from ..options import IMAGE_SUFFIXES, choice_option, number_option, output_file, threads_option
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
@number_option(
    "--scale",
    float,
    HeightToNormalOptions.scale,
    "S",
    "Height that a change of 1 stands for, in the unit of --width.  "
    f"[default: what the file says of itself, else {DEFAULT_SCALE:g}]",
)
@number_option(
    "--width", float, HeightToNormalOptions.width, "W", "How wide the image is; texels are square."
)
@choice_option(
    "--wrap", WRAPS, HeightToNormalOptions.wrap, "Beyond the border: it tiles, or it ends."
)
@choice_option(
    "--derivative",
    DERIVATIVES,
    HeightToNormalOptions.derivative,
    "central blurs nothing; sobel and scharr average over three rows.",
)
@choice_option(
    "--convention",
    CONVENTIONS,
    BakeOptions.convention,
    "Green channel: opengl is +Y up, directx +Y down.",
)
@number_option(
    "--bits",
    int,
    None,
    "8|16|32",
    "Bits a channel; 32 is float.  [default: the most that the format holds]",
)
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
    """Make a normal map of HEIGHT.

    The first channel counts. Heights that texbake wrote tell their scale in model units: give the
    width of the image in model units then.
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
