"""`texbake lighten`: fewer triangles and one set of images, all materials kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import LightenOptions

from ..html import command_line, html_option
from ..options import mesh_argument, options_of, output_file, report_option
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake lighten model.glb -o light.glb --html light.html
      texbake lighten model.fbx -o light.glb --faces 5000 --size 1024
    """
)
@mesh_argument("model")
@output_file("The lightened model.", (".glb",))
@options_of(LightenOptions)
@report_option
@html_option
@terminal_options
def lighten(
    model: Path,
    output: Path,
    report: Path | None,
    html: Path | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Make MODEL smaller, with all of its materials.

    MODEL is simplified, unwrapped once, and every channel of its materials is baked into one set of
    images: base color and alpha, metallic, roughness, occlusion, emissive, normal, clearcoat,
    transmission, sheen and specular. Its own normal maps are part of the new one.
    """
    options = LightenOptions(**choices)
    with terminal.progress() as progress:
        done = texbake.lighten_file(
            model,
            output,
            options,
            report=report,
            html=html,
            command=command_line(),
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)
