"""`texbake pack-textures`: pack several images into one."""

from __future__ import annotations

from pathlib import Path

import click

import texbake
from texbake import (
    PackOptions,
)

from ..options import (
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    options_of,
    output_file,
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
@click.argument(
    "images", nargs=-1, required=True, type=FileOf(IMAGE_SUFFIXES), metavar="IMAGE... [OUTPUT]"
)
@output_file("The packed image.", IMAGE_SUFFIXES, after="images")
@click.option(
    "--mesh",
    "meshes",
    multiple=True,
    type=FileOf(MESH_SUFFIXES),
    metavar="MESH",
    help="Move the texture coordinates of this mesh with its image; one per image, in their order.",
)
@click.option(
    "--meshes-to",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder for the moved meshes, which keep their names; made if it is missing.",
)
@options_of(PackOptions)
@click.option(
    "--data", is_flag=True, help="Treat the images as data, such as roughness, not as colors."
)
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
    """Pack several IMAGEs into one.

    The texture coordinates of their meshes move with them. Texels are copied one to one where
    there is room. All texture coordinates of a mesh must lie in the unit square, because an
    image inside another one cannot tile.
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
