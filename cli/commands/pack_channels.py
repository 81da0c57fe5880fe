"""`texbake pack-channels`: pack gray maps as the channels of one image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import PackChannelsOptions

from ..options import IMAGE_SUFFIXES, Decorator, options_of, output_file, threads_option
from ..terminal import Terminal, terminal_options


def _channel(name: str, **extra: Any) -> Decorator[Any]:
    """Add an option that says what a channel holds."""
    return click.option(
        f"--{name}",
        metavar="FILE[:r|g|b|a]|VALUE",
        help=f"What goes to {name}: a gray map, one channel of an image, or a value from 0 to 1 "
        "for all texels.",
        **extra,
    )


@click.command(
    epilog="""
    \b
    Example:
      texbake pack-channels --red ao.png --green roughness.png --blue metallic.png -o orm.png
      texbake pack-channels --red rock.exr:g --green 0.5 --blue 0 -o orm.png --bits 8
    """
)
@_channel("red", required=True)
@_channel("green", required=True)
@_channel("blue", required=True)
@_channel("alpha")
@output_file("The image with these channels.", IMAGE_SUFFIXES)
@options_of(PackChannelsOptions)
@threads_option
@terminal_options
def pack_channels(
    red: str,
    green: str,
    blue: str,
    alpha: str | None,
    output: Path,
    bits: int | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Pack gray maps as the channels of one image.

    glTF and Unreal take occlusion as red, roughness as green and metallic as blue. The maps are
    data: their codes are copied, with no conversion between sRGB and linear.
    """
    options = PackChannelsOptions(bits=bits)
    done = texbake.pack_channel_files(output, red, green, blue, alpha, options, threads=threads)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
