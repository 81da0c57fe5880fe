"""The picture of texture coordinates as a file: pixels, or lines that other programs paint over."""

from __future__ import annotations

from pathlib import Path

from texbake.errors import FileFormatError
from texbake.files import PathLike, check_writable, replacing
from texbake.mapping.layout import draw_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.mesh import Mesh
from texbake.texture.image import write_image

LAYOUT_SUFFIXES = (".png", ".svg")


def check_layout(path: PathLike) -> None:
    """Raise now if `write_layout` could not write there.

    Raises
    ------
    FileFormatError
        The suffix is neither .png nor .svg.
    FileError
        The folder is missing or cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in LAYOUT_SUFFIXES:
        raise FileFormatError(
            f"{path}: layouts cannot be written as {suffix!r}; use {' or '.join(LAYOUT_SUFFIXES)}"
        )
    check_writable(path)


def write_layout(
    mesh: Mesh,
    path: PathLike,
    size: int | tuple[int, int] = 1024,
    *,
    heat: bool = False,
    threads: int | None = None,
) -> None:
    """Draw the texture coordinates of a mesh into a PNG or SVG file, by its suffix.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    path
        The file appears whole or not at all.
    size : int or (int, int)
        Pixels a side, or (width, height), of one tile.
    heat
        Color faces by their stretch, with a scale; see `draw_layout`.
    threads
        None for every processor.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    FileFormatError
        The suffix is neither .png nor .svg.
    FileError
        The file cannot be written.
    """
    check_layout(path)
    if Path(path).suffix.lower() == ".png":
        picture = draw_layout(mesh, size, heat=heat, threads=threads)
        write_image(picture, path, color=True, threads=threads)
        return
    document = layout_svg(mesh, size, heat=heat)
    with replacing(path) as temporary:
        temporary.write_text(document, encoding="utf-8")
