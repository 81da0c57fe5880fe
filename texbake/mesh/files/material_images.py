"""Images and factors of the one material that a mesh file is written with, checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texbake.errors import FileError, OptionError
from texbake.files import PathLike
from texbake.metadata import CONVENTION, SPACE, from_description
from texbake.png import SIGNATURE, png_description

_JPEG_START = b"\xff\xd8\xff"


def image_file(path: PathLike) -> tuple[bytes, str]:
    """Bytes of a PNG or JPEG file, and its media type.

    Raises
    ------
    FileError
        It cannot be read.
    FileFormatError
        It is a damaged PNG file.
    OptionError
        It is of another format.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if data.startswith(SIGNATURE):
        png_description(path)  # raises where it is damaged
        return data, "image/png"
    if data.startswith(_JPEG_START):
        return data, "image/jpeg"
    raise OptionError(f"{path}: a material's images are PNG or JPEG alone; save it as PNG")


def check_normal_map(path: PathLike) -> None:
    """Raise `OptionError` for a normal map that says it is not in tangent space with +Y."""
    _, media_type = image_file(path)
    if media_type != "image/png":
        return
    facts = from_description(png_description(path))
    if facts.get(SPACE, "tangent") != "tangent":
        raise OptionError(
            f"{path}: it is in {facts[SPACE]} space; "
            "a material needs a map baked with --space tangent"
        )
    if facts.get(CONVENTION, "opengl") != "opengl":
        raise OptionError(
            f"{path}: its green channel is {facts[CONVENTION]}; "
            "glTF and USD need a map baked with --convention opengl"
        )


def color_factors(base_color: Sequence[float]) -> list[float]:
    """Four factors of three or four; raise `OptionError` where they are none."""
    factors = [float(factor) for factor in base_color]
    if len(factors) not in (3, 4) or not all(0.0 <= factor <= 1.0 for factor in factors):
        raise OptionError(f"base_color: {factors} are not three or four factors between 0 and 1")
    return factors if len(factors) == 4 else [*factors, 1.0]
