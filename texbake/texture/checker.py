"""A checker with numbered cells, which shows how texture coordinates distort an image.

Cells are named as on a map: rows are letters, with A at the bottom, columns are numbers. Mirrored
names show mirrored texture coordinates, upside-down names show rotated ones, and cells that are not
square show stretching. At a seam, the names show where the texture continues.
"""

from __future__ import annotations

import string

import numpy as np

from texbake.errors import OptionError
from texbake.mapping.layout import text_coverage
from texbake.mesh.mesh import Float32Array
from texbake.mesh.oklch import linear_from_oklch

MAX_CELLS = len(string.ascii_uppercase)

# Oklab lightness of the two kinds of cells and of the names on them.
_LIGHT, _DARK, _INK = 0.86, 0.70, 0.22
_CHROMA = 0.11
_LEAST_NAMED_PX = 14  # smaller cells have no room for a name


def checker_image(size: int | tuple[int, int] = 1024, n_cells: int = 8) -> Float32Array:
    """Draw a checker whose cells each have a name and a color.

    Parameters
    ----------
    size : int or (int, int)
        Texels along each side, or (width, height).
    n_cells : int
        Cells along each side, up to 26. Cells have whole texels: if the size is not a multiple of
        their number, some are one texel wider than others.

    Returns
    -------
    (H, W, 3) float32
        Linear values in [0, 1]; row 0, with the last letter, is at the top. The image tiles.

    Raises
    ------
    OptionError
        There are no cells, more than 26, or more cells than texels.

    Examples
    --------
    >>> checker_image(64, 4).shape
    (64, 64, 3)
    """
    width, height = (size, size) if isinstance(size, int) else size
    if not 1 <= n_cells <= MAX_CELLS:
        raise OptionError(f"n_cells: {n_cells} is out of range; it must be 1 to {MAX_CELLS}")
    if min(width, height) < n_cells:
        raise OptionError(f"size: {width} x {height} texels are too few for {n_cells} cells a side")
    columns = np.arange(n_cells + 1) * width // n_cells
    rows = height - np.arange(n_cells + 1) * height // n_cells  # from the bottom edge up
    image = np.empty((height, width, 3), dtype=np.float32)
    for row in range(n_cells):
        for column in range(n_cells):
            cell = image[rows[row + 1] : rows[row], columns[column] : columns[column + 1]]
            lightness = _LIGHT if (row + column) % 2 else _DARK
            # A row runs through all hues; a column runs through the step between two of them.
            hue = 360.0 * (column + row / n_cells) / n_cells
            cell[:] = linear_from_oklch(lightness, _CHROMA, hue)
            _name(cell, f"{string.ascii_uppercase[row]}{column + 1}")
    return image


def _name(cell: Float32Array, name: str) -> None:
    """Draw a name in the middle of a cell, and a mark in its corner at the least u and v."""
    height, width = cell.shape[:2]
    if min(height, width) < _LEAST_NAMED_PX:
        return
    size = int(0.5 * min(height, width))
    ink = text_coverage(name, size)
    while ink.shape[1] > 0.8 * width and size > 1:
        size -= 1
        ink = text_coverage(name, size)
    top, left = (height - ink.shape[0]) // 2, (width - ink.shape[1]) // 2
    color = linear_from_oklch(_INK, 0.0, 0.0).astype(np.float32)
    area = cell[top : top + ink.shape[0], left : left + ink.shape[1]]
    area += ink[:, :, None] * (color - area)
    # The triangle marks which way is up for names such as H8, which read the same upside down.
    side = max(2, min(height, width) // 7)
    for step in range(side):
        cell[height - side + step, : step + 1] = color
