"""The pictures of the six sides of a box, laid out in the texture.

They lie as the sides of a die seen from outside, each upright, all in one scale and with square
texels:

    +----+ +----+ +----+
    | +x | | +y | | +z |
    +----+ +----+ +----+
    +----+ +----+ +----+
    | -x | | -y | | -z |
    +----+ +----+ +----+
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mapping.classical.frames import in_frame, upright_frame
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import FloatArray

N_SIDES = 6


def side_pictures(
    points: FloatArray,
    sides: npt.NDArray[np.integer[Any]],
    reach: FloatArray,
    options: UnwrapOptions,
) -> FloatArray:
    """Coordinates of faces that are seen from the sides of a box.

    Parameters
    ----------
    points : (F, 3, 3) float64
        Corners about the center of the box; +y is up in the pictures.
    sides : (F,) int
        Side of each face: 0 to 5 for +x, -x, +y, -y, +z, -z.
    reach : (3,) float64
        Half the size of the box.
    options : UnwrapOptions
        `size`, `padding` and `overlap` are read.

    Returns
    -------
    (F, 3, 2) float64
        Each side in its own cell, the center of the box in the middle of it and `padding` texels
        around it; with `overlap`, each in the whole square. The scale, one for all, is the
        greatest for which everything fits.

    Raises
    ------
    OptionError
        The padding leaves nothing of the texture.
    """
    if options.overlap:
        size = np.ones(2)
        middles, per_length = np.full((N_SIDES, 2), 0.5), _scale(0.5, reach.max())
    else:
        size = np.array([options.width_px, options.height_px], dtype=np.float64)
        middles, per_length = _cells(reach, size, options.padding)
    corners = np.empty((len(points), 3, 2))
    for side, axis in enumerate(np.repeat(np.eye(3), 2, axis=0)):
        at_side = sides == side
        frame = upright_frame(axis if side % 2 == 0 else -axis)
        corners[at_side] = (
            in_frame(points[at_side], frame[:2]) * per_length + middles[side]
        ) / size
    return corners


def _cells(reach: FloatArray, size: FloatArray, padding: int) -> tuple[FloatArray, float]:
    """(6, 2) middles of the cells, and the length of a local unit; in texels.

    Half the width of a side is how far the mesh reaches along x or z, half its height how far it
    reaches along y or z. So columns are as wide as their sides, and both rows as high as the
    highest of theirs.
    """
    half_widths = reach[[2, 0, 0]]
    half_height = reach[1:].max()
    free = size - np.array([4.0, 3.0]) * padding
    if (free <= 0.0).any():
        raise OptionError(
            f"padding: {padding} texels around six sides leave nothing of "
            f"{size[0]:.0f} x {size[1]:.0f}; take less padding or a larger size"
        )
    per_length = _scale(free, np.array([2.0 * half_widths.sum(), 4.0 * half_height]))
    half_widths, half_height = half_widths * per_length, half_height * per_length
    s = np.cumsum(2.0 * half_widths + padding) - half_widths
    t = padding + half_height + np.array([2.0 * half_height + padding, 0.0])
    return np.stack([np.repeat(s, 2), np.tile(t, 3)], axis=1), per_length


def _scale(free: npt.ArrayLike, needed: npt.ArrayLike) -> float:
    """Greatest scale at which all lengths fit into what is free; 1 where all of them are 0."""
    with np.errstate(divide="ignore"):
        scale = float(np.min(np.asarray(free) / needed))
    return scale if math.isfinite(scale) else 1.0
