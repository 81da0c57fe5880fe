"""`texbake split-channels`: split an image into a gray map for each channel."""

from __future__ import annotations

from pathlib import Path

import click

import texbake

from ..options import IMAGE_SUFFIXES, output_folder, threads_option
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake split-channels orm.png -o maps --names occlusion,roughness,metallic
      texbake split-channels orm.png -o maps --names ,roughness
    """
)
@click.argument("image", type=FileOf(IMAGE_SUFFIXES))
@output_folder("Folder for the maps; made if it is missing.", required=True)
@click.option(
    "--names",
    metavar="NAME,...",
    help="What each channel is, for the names of the files; an empty name leaves a channel out.  "
    "[default: red,green,blue,alpha]",
)
@threads_option
@terminal_options
def split_channels(
    image: Path, output: Path, names: str | None, threads: int | None, terminal: Terminal
) -> None:
    """Split IMAGE into a gray map for each channel.

    The maps are data: their codes are copied, with the bits of IMAGE and no conversion between
    sRGB and linear.
    """
    done = texbake.split_channel_files(
        image, output, names=None if names is None else names.split(","), threads=threads
    )
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
