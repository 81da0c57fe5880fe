"""`texbake preview`: a picture of a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..options import (
    IMAGE_SUFFIXES,
    image_option,
    mesh_argument,
    output_file,
    picture_options,
    threads_option,
)
from ..outputs import check_distinct, check_picture
from ..terminal import Terminal, terminal_options

if TYPE_CHECKING:
    from texbake import RenderOptions


@click.command(
    epilog="""
    \b
    Example:
      texbake preview low.obj --normal-map normal.png -o low.png
      texbake preview scan.ply --up z --view 120,15 --size 1920x1080 -o scan.png
    """
)
@mesh_argument("mesh")
@output_file("The picture.", IMAGE_SUFFIXES)
@image_option("--normal-map", "Normals, in tangent, object or world space.")
@image_option("--displacement", "Heights; the mesh is cut into small triangles and moved by them.")
@image_option("--albedo", "Colors.")
@picture_options
@threads_option
@terminal_options
def preview(
    mesh: Path,
    output: Path,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    picture: RenderOptions,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Draw MESH, with its maps where it has any.

    A normal map says in its file which space and convention it has; one that does not is taken for
    tangent space and OpenGL. Heights are decoded by what their file says, or are model units.
    """
    check_distinct([output], [mesh, normal_map, displacement, albedo])
    check_picture(output)
    import texbake

    with terminal.progress() as progress:
        frame = texbake.render(
            texbake.read_mesh(mesh, progress=progress),
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=picture,
            threads=threads,
            progress=progress,
        )
        texbake.write_image(frame.color[:, :, :3], output, color=True, threads=threads)
    terminal.wrote([output])
