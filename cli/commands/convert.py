"""`texbake convert`: change the format of a mesh file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import texbake
from texbake import TransformOptions

from ..moving import moved
from ..options import WRITABLE_MESH_SUFFIXES, mesh_argument, options_of, output_file
from ..terminal import Terminal, terminal_options


@click.command(
    epilog="""
    \b
    Example:
      texbake convert statue.fbx statue.glb
      texbake convert part.stl -o part.obj --units mm --up z
    """
)
@mesh_argument("source")
@output_file("The file to write; its suffix sets the format.", WRITABLE_MESH_SUFFIXES)
@options_of(TransformOptions, "scale", "units", "up", "subdivide", "normals", "angle")
@terminal_options
def convert(source: Path, output: Path, terminal: Terminal, **options: Any) -> None:
    """Write the mesh in SOURCE in the format of OUTPUT.

    Keeps texture coordinates, normals, groups and vertex colors where the format has them. A GLB
    file keeps the materials of a glTF, OBJ, FBX or USD file with their images. An OBJ file keeps
    those channels that .mtl files have; that file and the images stand beside it. A warning names
    what is lost.
    """
    moved(source, output, texbake.TransformOptions(**options), terminal)
