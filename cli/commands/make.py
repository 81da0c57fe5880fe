"""`texbake make`: meshes of parametric surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake.mesh.parametric.options import SHAPE_DEFAULTS, SHAPES, MakeOptions

from ..options import IMAGE_SUFFIXES, WRITABLE_MESH_SUFFIXES, Decorator, number_option, output_file
from ..terminal import Terminal, terminal_options
from ..types import FileOf, Size


def _for(option: str, text: str) -> str:
    """Help of an option, with the shapes that read it and their defaults."""
    readers: dict[str, list[str]] = {}
    for shape, defaults in SHAPE_DEFAULTS.items():
        if option in defaults:
            default = defaults[option]
            shown = (
                "x".join(map(str, default)) if isinstance(default, tuple) else f"{default or 0:g}"
            )
            readers.setdefault(shown if default else "", []).append(shape)
    told = "; ".join(
        f"{', '.join(shapes)}{f': {shown}' if shown else ''}" for shown, shapes in readers.items()
    )
    return f"{text}  [{told}]"


def _file(flag: str, suffixes: tuple[str, ...], text: str) -> Decorator[Any]:
    return click.option(
        flag, type=FileOf(suffixes), metavar="FILE", help=_for(flag.removeprefix("--"), text)
    )


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
    """
)
@click.argument("shape", type=click.Choice(SHAPES), metavar="SHAPE")
@output_file("The mesh.", WRITABLE_MESH_SUFFIXES)
@click.option(
    "--resolution",
    type=Size(),
    metavar="N|NUxNV",
    help=_for("resolution", "Squares along u and v; flat sides have one each, pixels one vertex."),
)
@number_option("--radius", float, None, "R", _for("radius", "In model units."))
@number_option("--height", float, None, "H", _for("height", "In model units; of white in images."))
@number_option("--width", float, None, "W", _for("width", "In model units."))
@number_option("--minor-radius", float, None, "R", _for("minor_radius", "Of the tube."))
@number_option("--sides", int, None, "N", _for("sides", "Flat sides instead of a round one."))
@click.option("--caps", is_flag=True, default=None, help=_for("caps", "Close it with flat ends."))
@number_option("--twists", int, None, "N", _for("twists", "Half turns of the strip."))
@number_option("--turns", float, None, "T", _for("turns", "Part of a whole turn, up to 1."))
@number_option("--crease", float, None, "DEG", _for("crease", "Angle from which edges are hard."))
@_file("--profile", (".txt", ".csv", ".dat"), "Lines of radius and height.")
@_file("--patches", (".txt", ".bpt", ".dat"), "Control points, 16 a patch.")
@_file("--image", IMAGE_SUFFIXES, "Heights, from black to white.")
@terminal_options
def make(shape: str, output: Path, image: Path | None, terminal: Terminal, **choices: Any) -> None:
    """Make a mesh of a surface with coordinates (u, v).

    SHAPE is plane, cylinder, cone, sphere, torus, mobius, revolution (a profile swept about y),
    bezier (bicubic patches, such as the classic teapot's) or height-field. Options tell in
    brackets which shapes read them, with their defaults.
    """
    with terminal.progress():
        done = texbake.make_file(shape, output, MakeOptions(**choices, image=image))
    mesh = done.report
    terminal.summary([("faces", f"{mesh.n_faces:,}"), ("vertices", f"{mesh.n_vertices:,}")])
    terminal.wrote(done.files)
