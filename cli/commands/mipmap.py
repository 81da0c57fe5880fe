"""`texbake mipmap`: the mip levels of an image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.texture.mip_options import MIP_FILTERS, MIP_KINDS, MIP_WRAPS, MipOptions

from ..options import IMAGE_SUFFIXES, choice_option, threads_option
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake mipmap wood.png -o levels/
      texbake mipmap wood.png -o levels.png --filter kaiser --wrap clamp
      texbake mipmap normal.png -o levels/ --kind normal --roughness rough/
    """
)
@click.argument("image", type=FileOf(IMAGE_SUFFIXES))
@click.option(
    "-o",
    "--output",
    type=FileOf(IMAGE_SUFFIXES),
    required=True,
    metavar="DIR|PICTURE",
    help="A folder for one file a level, made if missing; or one picture of them side by side.",
)
@click.option(
    "--kind",
    "averaged_as",  # `kind` is what `terminal_options` takes
    type=click.Choice(MIP_KINDS),
    default=MipOptions.kind,
    show_default=True,
    help="Colors are averaged in linear light, normals as vectors, data as they are.",
)
@choice_option(
    "--filter", MIP_FILTERS, MipOptions.filter, "Mean of the area, or a sharper windowed sinc."
)
@choice_option("--wrap", MIP_WRAPS, MipOptions.wrap, "What lies beyond the borders.")
@click.option(
    "--roughness",
    type=FileOf(IMAGE_SUFFIXES),
    metavar="DIR|PICTURE",
    help="Also write, of normals, the roughness that their mean stands for.",
)
@threads_option
@terminal_options
def mipmap(
    image: Path,
    output: Path,
    averaged_as: str,
    roughness: Path | None,
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Write the mip levels of IMAGE, down to one texel."""
    options = MipOptions(kind=averaged_as, **choices)
    with terminal.progress():
        done = texbake.mipmap_files(image, output, options, roughness=roughness, threads=threads)
    terminal.wrote(done.files)
