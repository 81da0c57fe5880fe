"""Kinds of files that steps write."""

from __future__ import annotations

from texbake.errors import OptionError

MESH_FORMATS = ("obj", "ply", "glb", "stl", "off")
IMAGE_FORMATS = ("png", "exr", "tif", "tga")


def check_format(value: object, known: tuple[str, ...]) -> None:
    """Raise `OptionError` where a format is not known."""
    if value not in known:
        raise OptionError(f"format: {value!r} is not one of {', '.join(known)}")
