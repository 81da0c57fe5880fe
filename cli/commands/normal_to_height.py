"""`texbake normal-to-height`: normals to heights."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake.texture.height_options import CONVENTIONS, METHODS, WRAPS, NormalToHeightOptions

from ..options import IMAGE_SUFFIXES, choice_option, number_option, output_file, threads_option
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
@output_file("The heights.", (".png", ".exr", ".tif", ".tiff", ".tga"))
@choice_option(
    "--method",
    METHODS,
    NormalToHeightOptions.method,
    "poisson fits steps from texel to texel; frankot-chellappa fits waves that tile.",
)
@choice_option("--wrap", WRAPS, NormalToHeightOptions.wrap, "The map tiles, or it ends.")
@number_option(
    "--width",
    float,
    NormalToHeightOptions.width,
    "W",
    "How wide the image is, in the unit that heights come in.",
)
@choice_option(
    "--convention",
    CONVENTIONS,
    NormalToHeightOptions.convention,
    "Green channel: +Y up or down.  [default: what the file says of itself, else opengl]",
)
@number_option(
    "--bits",
    int,
    None,
    "8|16|32",
    "Bits; 32 is float.  [default: the most that the format holds]",
)
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
    """Find the heights of the normal map NORMAL.

    It is in tangent space.

    Their mean is 0, since normals do not tell it. The file says their scale.
    """
    options = NormalToHeightOptions(method=method, wrap=wrap, width=width, convention=convention)
    done = texbake.normal_to_height_file(normal, output, options, bits=bits, threads=threads)
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
