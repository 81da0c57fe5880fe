"""Pictures as data inside a page."""

from __future__ import annotations

import base64
import io

import numpy as np
import numpy.typing as npt

from texbake.texture.encoding import encode_srgb, quantize_unsigned


def picture_codes(picture: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """(H, W, 3) uint8: sRGB codes of a picture in linear light, without its opacity."""
    return np.asarray(quantize_unsigned(encode_srgb(picture[..., :3]), 8), np.uint8)


def png_of(picture: npt.NDArray[np.float32]) -> bytes:
    """Return a picture in linear light as the bytes of a PNG file."""
    return png_of_codes(picture_codes(picture), optimize=True)


def png_of_codes(codes: npt.NDArray[np.uint8], *, optimize: bool = False) -> bytes:
    """Return (H, W) or (H, W, C) codes as the bytes of a PNG file; `optimize` takes longer."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(codes).save(file, "PNG", optimize=optimize)
    return file.getvalue()


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """Return a file as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
