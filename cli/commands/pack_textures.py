"""`texbake pack-textures`: several images in one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from texbake.errors import OptionError
from texbake.files import check_folder, check_writable, make_folder
from texbake.jobs.outputs import check_distinct, check_mesh
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
    targets = _targets(images, meshes, folder)
    check_distinct([output, *targets], [*images, *meshes])
    check_writable(output)
    import texbake
    from texbake.texture.image_files import bits_for
    from texbake.texture.image_formats import check_image_format

    check_image_format(output, color=not data)
    with terminal.progress() as progress:
        read = [texbake.read_image(path, color=not data, threads=threads) for path in images]
        packed = texbake.pack_textures([image.pixels for image in read], options)
        moved = [
            packed.remapped(texbake.read_mesh(path, progress=progress), i)
            for i, path in enumerate(meshes)
        ]
        deepest = max(read, key=lambda image: image.bits)
        bits = bits_for(output, packed.pixels, deepest)
        if folder is not None:
            make_folder(folder)
        for mesh, path in zip(moved, targets, strict=True):
            texbake.write_mesh(mesh, path)
        texbake.write_image(packed.pixels, output, color=not data, bits=bits, threads=threads)
    if packed.scale < 1.0:
        terminal.warn(
            f"{output}: the images are made smaller, to {100 * packed.scale:.1f} % of their sides; "
            "give a larger --size to keep them as they are"
        )
    height, width = packed.pixels.shape[:2]
    terminal.summary([("size", f"{width} x {height}, {100 * packed.filled:.1f} % filled")])
    terminal.summary(
        [
            (f"  {path.name}", f"{place.width} x {place.height} at {place.left}, {place.top}")
            for path, place in zip(images, packed.places, strict=True)
        ]
    )
    terminal.wrote([output, *targets])


def _targets(images: Sequence[Path], meshes: Sequence[Path], folder: Path | None) -> list[Path]:
    """Return a file for each moved mesh, checked before any work."""
    if (folder is None) != (not meshes):
        raise OptionError("mesh, meshes-to: give both, a mesh for each image and a folder for them")
    if folder is None:
        return []
    if len(meshes) != len(images):
        raise OptionError(
            f"mesh: {len(meshes)} are given for {len(images)} images; give one for each, in order"
        )
    check_folder(folder)
    targets = [folder / path.name for path in meshes]
    for target in targets:
        check_mesh(target, folder_is_made=True)
    return targets
