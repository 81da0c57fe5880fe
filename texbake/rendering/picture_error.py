"""How far a picture is from another, as a screen of 8 bits shows them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.texture.encoding import encode_srgb
from texbake.texture.image import FloatImage


def picture_error(
    picture: FloatImage, truth: FloatImage, where: npt.NDArray[np.bool_] | None = None
) -> float:
    """Return the root mean square difference in the 255 steps of an 8-bit screen.

    `picture`, `truth` (H, W, 3 or 4) float32, linear light; `where` (H, W) bool: pixels to compare.
    """
    difference = 255.0 * (
        encode_srgb(picture[..., :3]).astype(np.float64) - encode_srgb(truth[..., :3])
    )
    squares = np.square(difference).mean(axis=-1)
    return float(np.sqrt(squares.mean() if where is None else squares[where].mean()))
