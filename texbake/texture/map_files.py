"""Normal and height maps as files that say how they are to be read."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.texture.encoding import encode_heights, encode_normals, height_range
from texbake.texture.image import write_image
from texbake.texture.image_formats import check_image_format, holds_floats


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
        8, 16 or 32 a channel; None: the most the format holds.

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
