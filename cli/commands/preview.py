"""`texbake preview`: a picture of a mesh."""

from __future__ import annotations

from pathlib import Path

import click

from texbake.render.options import BACK_FACES, UPS, RenderOptions

from ..options import (
    IMAGE_SUFFIXES,
    choice_option,
    image_option,
    mesh_argument,
    number_option,
    output_file,
    size_option,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import View

_DEFAULT_SIZE = (RenderOptions.width, RenderOptions.height)


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
@size_option("x".join(map(str, _DEFAULT_SIZE)), "Pixels of the picture.")
@click.option(
    "--view",
    type=View(),
    default=",".join(f"{angle:g}" for angle in RenderOptions.view),
    show_default=True,
    help="Azimuth and elevation in degrees, and the distance from the middle in model units.",
)
@choice_option("--up", UPS, RenderOptions.up, "Axis of the world that is up in the picture.")
@choice_option(
    "--back-faces", BACK_FACES, RenderOptions.back_faces, "Triangles that are seen from behind."
)
@number_option(
    "--supersampling",
    int,
    RenderOptions.supersampling,
    "N",
    "Samples of a pixel along one side, N x N in all.",
)
@threads_option
@terminal_options
def preview(
    mesh: Path,
    output: Path,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    size: int | tuple[int, int],
    view: tuple[float, ...],
    up: str,
    back_faces: str,
    supersampling: int,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Draw MESH, with its maps where it has any.

    A normal map says in its file which space and convention it has; one that does not is taken for
    tangent space and OpenGL. Heights are decoded by what their file says, or are model units.
    """
    width, height = (size, size) if isinstance(size, int) else size
    options = RenderOptions(
        width=width,
        height=height,
        view=view,  # type: ignore[arg-type]  # the options check its length
        up=up,
        back_faces=back_faces,
        supersampling=supersampling,
    )
    import texbake
    from texbake.files import check_writable
    from texbake.texture.image import check_image_format

    check_writable(output)
    check_image_format(output, color=True, channels=3)
    with terminal.progress() as progress:
        frame = texbake.render(
            texbake.read_mesh(mesh, progress=progress),
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=options,
            threads=threads,
            progress=progress,
        )
        texbake.write_image(frame.color[:, :, :3], output, color=True, threads=threads)
    terminal.wrote([output])
