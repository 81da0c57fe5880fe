"""Perceptual colors: equal lightness for any hue, and a diverging color scale.

Based on: Ottosson, "A perceptual color space for image processing", 2020 (Oklab); Moreland,
"Diverging Color Maps for Scientific Visualization", 2009.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray

# Oklab to cube roots of cone responses, and those cubed to linear sRGB.
_CONES = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_LINEAR_SRGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)
# Lightness, chroma and hue in degrees at both ends of the scale, and the lightness of its middle.
# Color-blind readers can distinguish blue and amber, and neither is red, the color of errors.
_LOW_END = (0.40, 0.17, 262.0)
_HIGH_END = (0.50, 0.13, 62.0)
_MIDDLE = 0.96


def linear_from_oklch(
    lightness: npt.ArrayLike, chroma: npt.ArrayLike, hue_deg: npt.ArrayLike
) -> FloatArray:
    """(..., 3) float64 linear RGB in [0, 1] of colors in Oklch, the polar form of Oklab."""
    lightness, chroma, hue = np.broadcast_arrays(lightness, chroma, np.radians(hue_deg))
    lab = np.stack([lightness, chroma * pm.cos(hue), chroma * pm.sin(hue)], axis=-1)
    cones = _transformed(lab, _CONES)
    return np.asarray(np.clip(_transformed(cones * cones * cones, _LINEAR_SRGB), 0.0, 1.0))


def _transformed(vectors: FloatArray, matrix: FloatArray) -> FloatArray:
    return np.asarray((vectors[..., None, :] * matrix).sum(axis=-1))


def diverging(levels: npt.ArrayLike) -> FloatArray:
    """(..., 3) linear RGB of a diverging scale: blue at -1, nearly white at 0, amber at 1."""
    levels = np.clip(np.asarray(levels, dtype=np.float64), -1.0, 1.0)
    ends = np.where((levels < 0.0)[..., None], _LOW_END, _HIGH_END)
    size = np.abs(levels)
    return linear_from_oklch(
        _MIDDLE + size * (ends[..., 0] - _MIDDLE), size * ends[..., 1], ends[..., 2]
    )
