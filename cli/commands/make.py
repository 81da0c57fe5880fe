"""`texbake make`: make meshes of parametric surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    SHAPES,
    MakeOptions,
    option_field,
)

from ..options import (
    IMAGE_SUFFIXES,
    WRITABLE_MESH_SUFFIXES,
    Decorator,
    options_of,
    output_file,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf


def _file(flag: str, suffixes: tuple[str, ...]) -> Decorator[Any]:
    text = option_field(MakeOptions, flag.removeprefix("--")).option.help
    return click.option(flag, type=FileOf(suffixes), metavar="FILE", help=text)


@click.command(
    epilog="""
    \b
    Example:
      texbake make sphere -o ball.obj --resolution 256x128
      texbake make cylinder -o prism.obj --sides 6 --caps --height 3
      texbake make mobius -o strip.obj --twists 3
      texbake make revolution -o vase.glb --profile vase.txt --resolution 96x64
      texbake make bezier -o teapot.obj --patches teapot.txt --resolution 24
      texbake make height-field -o hill.ply --image hill.png --height 0.4
      texbake make cylindrical-range -o head.ply --image radius.exr --max-step 0.02
    """
)
@click.argument("shape", type=click.Choice(SHAPES), metavar="SHAPE")
@output_file("The mesh.", WRITABLE_MESH_SUFFIXES)
@options_of(MakeOptions, without=("profile", "patches", "image"))
@_file("--profile", (".txt", ".csv", ".dat"))
@_file("--patches", (".txt", ".bpt", ".dat"))
@_file("--image", IMAGE_SUFFIXES)
@terminal_options
def make(shape: str, output: Path, image: Path | None, terminal: Terminal, **choices: Any) -> None:
    """Make a mesh of a parametric surface.

    SHAPE is plane, cylinder, cone, sphere, torus, mobius, revolution (a profile swept about y),
    bezier (bicubic patches, such as the classic teapot's), height-field, cylindrical-range (radii
    over angle and height, as scanners give them) or depth-image (of a depth camera). Every vertex
    has (u, v) as its texture coordinates. The default of an option shows the shapes that take it.
    """
    with terminal.progress():
        done = texbake.make_file(shape, output, MakeOptions(**choices, image=image))
    mesh = done.report
    terminal.summary([("faces", f"{mesh.n_faces:,}"), ("vertices", f"{mesh.n_vertices:,}")])
    terminal.wrote(done.files)
