"""Images of maps that are one number per texel."""

from __future__ import annotations

import numpy as np

from texbake.errors import OptionError
from texbake.texture.image import Image

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
