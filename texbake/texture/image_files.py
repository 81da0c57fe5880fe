"""Sets of images written together, and normal and height maps written with their metadata."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.files import PathLike, make_folder, replacing
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.texture.encoding import encode_heights, encode_normals, height_range
from texbake.texture.image import Image, write_image
from texbake.texture.image_formats import check_image_format, holds_floats

_GREATEST_HALF = 65504.0


def write_images(
    images: Mapping[Path, npt.NDArray[Any]],
    *,
    color: bool,
    bits: int | None = None,
    threads: int | None = None,
) -> None:
    """Write images; all of them appear, or none.

    Parameters
    ----------
    images
        Pixels (H, W, C) by the file they go to; its folder is made if missing.
    color, bits
        As `write_image` takes them.

    Raises
    ------
    FileError, OptionError
        As `write_image` does.
    """
    for file, pixels in images.items():
        check_image_format(
            file, check_image_format(file, bits, color=color), channels=pixels.shape[2]
        )
    for folder in {file.parent for file in images}:
        make_folder(folder)
    with ExitStack() as together:
        places = [together.enter_context(replacing(file)) for file in images]
        for place, pixels in zip(places, images.values(), strict=True):
            write_image(pixels, place, color=color, bits=bits, threads=threads)


def suffix_like(source: Image) -> str:
    """Suffix of files that hold what a file held without loss: its own, or that of PNG.

    >>> suffix_like(Image(np.zeros((1, 1, 3), np.float32), name="sky.hdr"))
    '.hdr'
    """
    suffix = Path(source.name).suffix.lower()
    if source.is_float:
        return suffix if suffix in (".exr", ".hdr", ".tif", ".tiff") else ".exr"
    return suffix if suffix in (".tga", ".tif", ".tiff") else ".png"


def bits_for(path: PathLike, pixels: npt.NDArray[np.float32], source: Image) -> int | None:
    """Bits per channel of a file made of another, so that nothing is lost without need.

    None, which is what is usual for the format, but as many as the source has for codes of 16 bits
    and floats where the format has such, and 32 for floats beyond the greatest half.
    """
    wanted = 32 if source.is_float else source.bits
    if Path(path).suffix.lower() == ".exr":
        return 32 if np.abs(pixels).max() > _GREATEST_HALF else None
    try:
        return None if wanted == 8 else check_image_format(path, wanted)
    except OptionError:
        return None


def clipped_share(path: PathLike, pixels: npt.NDArray[np.float32], bits: int | None) -> float:
    """Share of the values that a file of codes from 0 to 1 cannot hold."""
    if holds_floats(path, check_image_format(path, bits, color=True)):
        return 0.0
    return float(np.mean((pixels < 0.0) | (pixels > 1.0)))


def write_normals(
    normals: npt.NDArray[Any],
    path: PathLike,
    *,
    convention: str = "opengl",
    bits: int | None = None,
    threads: int | None = None,
) -> None:
    """Write a normal map in tangent space.

    Parameters
    ----------
    normals : (H, W, 3) float32
        Unit vectors, y up.
    path
        png, exr, tif or tga.
    convention
        Green channel: `opengl` (+Y up) or `directx` (+Y down).
    bits
        8, 16 or 32 bits per channel; None: the most the format holds.

    Raises
    ------
    OptionError, FileError
        As `write_image` does, or the format would change the normals.
    """
    bits = check_image_format(path, bits, channels=3, lossless=True)
    code_bits = 32 if holds_floats(path, bits) else bits
    pixels = encode_normals(normals, bits=code_bits, convention=convention, threads=threads)
    metadata = {SPACE: "tangent", CONVENTION: convention}
    write_image(pixels, path, bits=bits, metadata=metadata, threads=threads)


def write_heights(
    heights: npt.NDArray[Any],
    path: PathLike,
    *,
    bits: int | None = None,
    threads: int | None = None,
) -> tuple[float, float]:
    """Write a height map.

    Parameters
    ----------
    heights : (H, W) float32
        Lengths. Float files hold them as they are, integer files as h = d / scale + mid with the
        least scale that holds all of them.
    path
        png, exr, tif or tga.
    bits
        8, 16 or 32; None: the most the format holds.

    Returns
    -------
    mid, scale : float
        As the file says them.

    Raises
    ------
    OptionError, FileError
        As `write_image` does, or the format would change the heights.
    """
    bits = check_image_format(path, bits, channels=1, lossless=True)
    mid, scale = 0.0, 1.0
    code_bits = 32 if holds_floats(path, bits) else bits
    if code_bits != 32:
        mid, scale = height_range(heights, np.ones(heights.shape, np.bool_), bits=bits)
    pixels = encode_heights(heights, bits=code_bits, mid=mid, scale=scale, threads=threads)
    metadata = {DISPLACEMENT_MID: mid, DISPLACEMENT_SCALE: scale}
    write_image(pixels, path, bits=bits, metadata=metadata, threads=threads)
    return mid, scale
