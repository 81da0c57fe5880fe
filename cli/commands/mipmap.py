"""`texbake mipmap`: write the mip levels of an image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    MipOptions,
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
      texbake mipmap wood.png -o levels/
      texbake mipmap wood.png -o levels.png --filter kaiser --wrap clamp
      texbake mipmap normal.png -o levels/ --kind normal --roughness rough/
    """
)
@click.argument("image", type=FileOf(IMAGE_SUFFIXES))
@output_option(
    FileOf(IMAGE_SUFFIXES),
    "DIR|PICTURE",
    "A folder for one file per level, made if it is missing, or one picture of all levels.",
    required=True,
)
@options_of(MipOptions)
@click.option(
    "--roughness",
    type=FileOf(IMAGE_SUFFIXES),
    metavar="DIR|PICTURE",
    help="Also write the roughness of each level, from how much its normals vary.",
)
@threads_option
@terminal_options
def mipmap(
    image: Path,
    output: Path,
    roughness: Path | None,
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Write the mip levels of IMAGE, down to one texel."""
    options = MipOptions(**choices)
    with terminal.progress():
        done = texbake.mipmap_files(image, output, options, roughness=roughness, threads=threads)
    terminal.wrote(done.files)
