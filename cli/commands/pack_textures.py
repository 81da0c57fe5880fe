"""`texbake pack-textures`: several images in one."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake.texture.pack_options import EDGES, PackOptions

from ..options import (
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    choice_option,
    number_option,
    output_file,
    size_option,
    threads_option,
)
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake pack-textures wood.png steel.png -o atlas.png
      texbake pack-textures a.png b.png --mesh a.obj --mesh b.obj -o atlas.png --meshes-to packed
    """
)
@click.argument("images", nargs=-1, required=True, type=FileOf(IMAGE_SUFFIXES), metavar="IMAGE...")
@output_file("The image of all images.", IMAGE_SUFFIXES)
@click.option(
    "--mesh",
    "meshes",
    multiple=True,
    type=FileOf(MESH_SUFFIXES),
    metavar="MESH",
    help="A mesh whose coordinates are to move with its image: one for each image, in their order.",
)
@click.option(
    "--meshes-to",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder of the moved meshes, under their own names; made if missing.",
)
@size_option(
    PackOptions.size,
    "Texels of the whole; images that do not fit are made smaller.  [default: the least powers of "
    "two into which all fit as they are]",
)
@number_option(
    "--padding", int, PackOptions.padding, "PX", "Texels around each image that go on beyond it."
)
@choice_option(
    "--edges", EDGES, PackOptions.edges, "Padding repeats the nearest texel, or the image tiles."
)
@click.option("--data", is_flag=True, help="The images hold data, such as roughness, not colors.")
@threads_option
@terminal_options
def pack_textures(
    images: tuple[Path, ...],
    output: Path,
    meshes: tuple[Path, ...],
    folder: Path | None,
    size: int | tuple[int, int] | None,
    padding: int,
    edges: str,
    data: bool,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Put several IMAGEs into one, for one texture.

    The coordinates of their meshes move with them.

    Texels are copied one to one where there is room. A mesh needs all of its coordinates in the
    unit square, because an image within another one cannot tile.
    """
    options = PackOptions(size=size, padding=padding, edges=edges)
    with terminal.progress() as progress:
        done = texbake.pack_texture_files(
            images,
            output,
            options,
            meshes=meshes,
            mesh_outputs=folder,
            data=data,
            threads=threads,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    packed = done.report
    height, width = packed.pixels.shape[:2]
    terminal.summary([("size", f"{width} x {height}, {100 * packed.filled:.1f} % filled")])
    terminal.summary(
        [
            (f"  {path.name}", f"{place.width} x {place.height} at {place.left}, {place.top}")
            for path, place in zip(images, packed.places, strict=True)
        ]
    )
    terminal.wrote(done.files)
