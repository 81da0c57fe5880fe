"""Whether outputs can be written, asked before the work and not after it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from texbake.errors import FileFormatError, OptionError
from texbake.files import check_writable

from .options import WRITABLE_MESH_SUFFIXES


def check_picture(path: Path | None) -> None:
    """Raise if an 8-bit picture could not be written; None is fine."""
    if path is not None:
        from texbake.texture.image_formats import check_image_format

        check_image_format(path, color=True, channels=3)
        check_writable(path)


def check_mesh(path: Path, *, folder_is_made: bool = False) -> None:
    """Raise if a mesh could not be written; its folder need not be there if it is made later."""
    if path.suffix.lower() not in WRITABLE_MESH_SUFFIXES:
        known = ", ".join(WRITABLE_MESH_SUFFIXES)
        raise FileFormatError(f"{path}: meshes cannot be written as {path.suffix!r}; use {known}")
    if not folder_is_made:
        check_writable(path)


def check_report(path: Path | None) -> None:
    """Raise if a report could not be written; None is fine."""
    if path is not None:
        check_writable(path)


def check_page(path: Path | None) -> None:
    """Raise if a page could not be written, or is called as some other file is; None is fine."""
    if path is not None:
        if path.suffix.lower() not in (".html", ".htm"):
            raise FileFormatError(f"{path}: a page is no {path.suffix!r} file; use .html")
        check_writable(path)


def check_distinct(outputs: Sequence[Path | None], inputs: Sequence[Path | None] = ()) -> None:
    """Raise if two outputs are one file, or if one would overwrite an input.

    None is fine. A mesh that the result may replace is no input in this sense.
    """
    read = {os.path.realpath(path) for path in inputs if path is not None}
    written = set()
    for path in outputs:
        if path is not None:
            file = os.path.realpath(path)
            if file in written:
                raise OptionError(f"{path}: two outputs have this name; give each its own")
            if file in read:
                raise OptionError(f"{path}: it is also an input; give the output another name")
            written.add(file)
