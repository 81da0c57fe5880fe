"""Heights to normals: the slopes of a height field, and the unit vectors that stand on it.

Based on: Scharr, "Optimale Operatoren in der digitalen Bildverarbeitung", 2000, for the weights
3 10 3; Blinn, "Simulation of wrinkled surfaces", 1978, for (-dh/dx, -dh/dy, 1). Departs from the
usual border rules where an image does not tile: it is continued by the parabola through its last
three texels, so that heights that curve evenly have exact normals up to the border.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError
from texbake.metadata import DISPLACEMENT_SCALE
from texbake.texture.height_options import DEFAULT_SCALE, HeightToNormalOptions
from texbake.texture.image import Image

# Of three texels side by side, in sixteenths: what a derivative averages across its direction.
_ACROSS = {"central": (0, 16, 0), "sobel": (4, 8, 4), "scharr": (3, 10, 3)}


def height_to_normal(
    heights: Image | npt.NDArray[Any], options: HeightToNormalOptions | None = None
) -> npt.NDArray[np.float32]:
    """Normals of a height field, in tangent space.

    Parameters
    ----------
    heights : Image, or (H, W) or (H, W, 1) float
        Row 0 at the top. Of an image the first channel, with the scale that its metadata tells.
    options
        None for `HeightToNormalOptions()`.

    Returns
    -------
    (H, W, 3) float32
        Unit vectors, x to the right, y up. Where a height nearby is not finite: (0, 0, 1).

    Raises
    ------
    OptionError
        The shape is not that of heights.
    FileFormatError
        The image's metadata tells a scale that is no number.

    Examples
    --------
    >>> ramp = np.tile(np.arange(4.0), (4, 1))
    >>> options = HeightToNormalOptions(scale=1.0, width=4.0, wrap="clamp")
    >>> bool(np.allclose(height_to_normal(ramp, options)[0, 0], (-(0.5**0.5), 0.0, 0.5**0.5)))
    True
    """
    options = options or HeightToNormalOptions()
    scale = height_scale(heights, options)
    field = _field(heights.pixels[..., :1] if isinstance(heights, Image) else heights)
    # Heights in texels, so that slopes are differences.
    field = field * (scale * field.shape[1] / options.width)
    with np.errstate(invalid="ignore", over="ignore"):
        extended = _extended(_extended(field, options.wrap).T, options.wrap).T
        along_x = _difference(extended, options.derivative)
        up_y = -_difference(extended.T, options.derivative).T
        normals = np.stack([-along_x, -up_y, np.ones_like(field)], axis=-1)
        normals /= np.sqrt(np.einsum("ijk,ijk->ij", normals, normals))[..., None]
    # Not finite, or too steep to square.
    normals[~np.isfinite(normals).all(axis=-1)] = (0.0, 0.0, 1.0)
    return normals.astype(np.float32)


def height_scale(heights: Image | npt.NDArray[Any], options: HeightToNormalOptions) -> float:
    """Height that a change of 1 stands for: as the options or the image say, or by default.

    Raises
    ------
    FileFormatError
        The image says something that is no number.
    """
    if options.scale is not None:
        return options.scale
    if not isinstance(heights, Image):
        return DEFAULT_SCALE
    scale = heights.metadata.get(DISPLACEMENT_SCALE, DEFAULT_SCALE)
    if not isinstance(scale, int | float) or not math.isfinite(scale):
        raise FileFormatError(
            f"{heights.name}: its {DISPLACEMENT_SCALE} {scale!r} is not a finite number; "
            "give one with --scale"
        )
    return float(scale)


def _field(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Values (H, W) as float64, of such an array or one of a single channel."""
    field = np.asarray(values, np.float64)
    field = field[..., 0] if field.ndim == 3 and field.shape[2] == 1 else field
    if field.ndim != 2 or field.size == 0:
        raise OptionError(f"heights: the shape {np.shape(values)} is not (height, width)")
    return field


def _extended(field: npt.NDArray[np.float64], wrap: str) -> npt.NDArray[np.float64]:
    """One row more above and below."""
    if wrap == "repeat":
        return np.concatenate([field[-1:], field, field[:1]])
    return np.concatenate([_row_before(field), field, _row_before(field[::-1])])


def _row_before(field: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(1, W): the row before the first, on the parabola or line that the first ones lie on."""
    if len(field) >= 3:
        return 3.0 * field[:1] - 3.0 * field[1:2] + field[2:3]
    return 2.0 * field[:1] - field[1:2] if len(field) == 2 else field


def _difference(extended: npt.NDArray[np.float64], derivative: str) -> npt.NDArray[np.float64]:
    """Slope along rows, a texel being 1 wide; one texel less on each side."""
    across = extended[1:-1]
    before, here, after = (weight / 16.0 for weight in _ACROSS[derivative])
    if before:  # 0 times what is not finite would still spread it
        across = before * extended[:-2] + here * across + after * extended[2:]
    return (across[:, 2:] - across[:, :-2]) / 2.0
