"""Colors for numbers of things: no two alike, and neighbors in number far apart in hue."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.colors import linear_from_oklch
from texbake.texture.encoding import encode_srgb

_GOLDEN_ANGLE_DEG = 180.0 * (3.0 - 5.0**0.5)
_LIGHTNESSES = (0.70, 0.52, 0.86)
_CHROMA = 0.15
_MOST_READABLE = 1024  # beyond it colors are told apart by programs alone
# Odd, so that multiplying by it leaves no two of 2^24 numbers alike.
_MIXER = 0x9E3779


def id_colors(n: int) -> npt.NDArray[np.uint8]:
    """Codes of the colors of 0, which is black and stands for nothing, and of 1 to n.

    Parameters
    ----------
    n
        Below 2^24.

    Returns
    -------
    (n + 1, 3) uint8
        sRGB; all different. The first colors do not depend on n, up to 1,024 of them.

    Examples
    --------
    >>> len({tuple(color) for color in id_colors(500).tolist()})
    501
    """
    colors = np.zeros((n + 1, 3), dtype=np.uint8)
    if n > _MOST_READABLE:
        mixed = (np.arange(n + 1, dtype=np.int64) * _MIXER) & 0xFFFFFF
        return np.stack([mixed >> 16, (mixed >> 8) & 255, mixed & 255], axis=1).astype(np.uint8)
    # More than enough for those that come out alike.
    i = np.arange(4 * (n + 1))
    lightness = np.array(_LIGHTNESSES)[i % len(_LIGHTNESSES)]
    linear = linear_from_oklch(lightness, _CHROMA, i * _GOLDEN_ANGLE_DEG)
    codes = np.floor(encode_srgb(linear) * 255.0 + 0.5).astype(np.uint8)
    _, firsts = np.unique(codes, axis=0, return_index=True)
    colors[1:] = codes[np.sort(firsts)[:n]]
    return colors
