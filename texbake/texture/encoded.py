"""Images as the bytes of a file, for formats that models carry: PNG, JPEG and WebP.

PNG keeps every code. JPEG and WebP lose some, the more the lower the quality; JPEG keeps as many
colors as brightnesses here (4:4:4), which normal maps need, and has no alpha. Pillow encodes both.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError, quoted
from texbake.texture.png_files import png_parts

# Names of the formats, with the suffixes of their files.
ENCODINGS = {"webp": ".webp", "jpeg": ".jpg", "png": ".png"}
# How long WebP looks for fewer bytes: from 4 on, twice the time saves less than a tenth.
_WEBP_METHOD = 4


def encode_image(
    codes: npt.NDArray[np.uint8],
    encoding: str,
    *,
    quality: int = 90,
    is_color: bool = False,
    threads: int | None = 1,
) -> bytes:
    r"""Encode an image as the bytes of a file.

    `codes` (H, W, 3) or (H, W, 4) uint8; `is_color`: whether a PNG file is marked as sRGB.

    Examples
    --------
    >>> encode_image(np.zeros((8, 8, 3), np.uint8), "jpeg")[:2]
    b'\xff\xd8'
    """
    if encoding not in ENCODINGS:
        raise OptionError(f"encoding: {quoted(encoding)} is not known; use {', '.join(ENCODINGS)}")
    encoding = encoding_of(codes, encoding)
    if encoding == "png":
        return b"".join(png_parts(codes, srgb=is_color, threads=threads))
    from PIL import Image

    buffer = io.BytesIO()
    options: dict[str, Any] = {"quality": quality, "subsampling": "4:4:4"}
    if encoding == "webp":
        options = {"quality": quality, "method": _WEBP_METHOD, "exact": True}
    Image.fromarray(codes).save(buffer, encoding.upper(), **options)
    return buffer.getvalue()


def encoding_of(codes: npt.NDArray[np.uint8], encoding: str) -> str:
    """Return the encoding that an image gets: PNG in place of JPEG where it has alpha."""
    return "png" if encoding == "jpeg" and codes.shape[2] == 4 else encoding
