"""Codes of a material's images, as their files hold them, and single components of them."""

from __future__ import annotations

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.materials import ChannelImage
from texbake.texture.encoding import encode_srgb
from texbake.texture.image import FloatImage, Image, decode_image

_ALPHA = 3


def image_codes(
    image: ChannelImage, *, is_color: bool, threads: int | None = None
) -> tuple[FloatImage, int]:
    """Decode an image without turning sRGB into linear values.

    `is_color`: whether floats, which are linear, become sRGB codes. Returns `pixels` (H, W, C)
    float32: codes, scaled to [0, 1]; `bits` per channel that hold them, 8 or 16.
    """
    found = decode_image(image.data, image.name, color=False, threads=threads)
    pixels = found.pixels
    if found.is_float:
        pixels = np.clip(np.nan_to_num(pixels), 0.0, 1.0)
        pixels = encode_srgb(pixels).astype(np.float32) if is_color else pixels
    return pixels, 8 if found.bits == 8 else 16


def components_of(pixels: FloatImage, components: tuple[int, ...]) -> FloatImage:
    """(H, W, n) components of pixels; gray is in all colors, and alpha is 1 where there is none."""
    n = pixels.shape[2]
    columns = []
    for component in components:
        if component == _ALPHA and n in (1, 3):
            columns.append(np.ones(pixels.shape[:2], np.float32))
        else:
            columns.append(pixels[..., component if n > 2 else int(component == _ALPHA)])
    return np.stack(columns, axis=2)


# Mean difference of red, green and blue, as a share of white, that JPEG leaves of a gray image.
_ROUNDING = 0.01


def check_gray(image: Image, what: str) -> None:
    """Raise where the red, green and blue of an image differ, so that none of them is the map."""
    colors = image.pixels[..., :3]
    if image.pixels.shape[2] < 3:
        return
    with np.errstate(invalid="ignore"):
        apart = colors.max(axis=2) - colors.min(axis=2)
    if float(np.nan_to_num(apart).mean()) > _ROUNDING:
        raise OptionError(
            f"{image.name}: {what} is one number per texel, and red, green and blue of this image "
            "differ; give a gray image, such as one that texbake split-channels makes of it"
        )
