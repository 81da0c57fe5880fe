"""UDIM tiles: the squares of texture space that the faces of a mesh lie in.

Tile 1001 is the unit square; numbers go on to the right, ten in a row, then up. A tile is baked if
the middle of a face with an area lies in it. A face that crosses a border is baked in each of those
tiles that it reaches into, and counted.

Based on: the UDIM convention of The Foundry's Mari, 1001 + column + 10 row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.file_names import FIRST_TILE
from texbake.mesh.mesh import FloatArray

_COLUMNS = 10
_LAST_TILE = 9999  # numbers have four digits
# What float32 files leave of coordinates on a border, in tiles.
_ON_BORDER = 1e-6

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Tiles:
    """The tiles of a mesh.

    Attributes
    ----------
    numbers : list of int
        In order.
    n_crossing : int
        Faces that reach into more than one tile.
    n_outside : int
        Faces whose middle lies in no tile: left of the first column, right of the tenth, below, or
        above the last number, 9999.
    """

    numbers: list[int]
    n_crossing: int
    n_outside: int
    _least: FloatArray
    _greatest: FloatArray

    @classmethod
    def of(cls, corner_uvs: FloatArray) -> Tiles:
        """Tiles of faces by the (F, 3, 2) coordinates of their corners."""
        least = np.asarray(corner_uvs.min(axis=1)) + _ON_BORDER
        greatest = np.asarray(corner_uvs.max(axis=1)) - _ON_BORDER
        columns, rows = np.floor(corner_uvs.mean(axis=1)).T
        edges = corner_uvs[:, 1:] - corner_uvs[:, :1]
        has_area = edges[:, 0, 0] * edges[:, 1, 1] != edges[:, 0, 1] * edges[:, 1, 0]
        numbers = FIRST_TILE + columns + _COLUMNS * rows
        inside = (columns >= 0) & (columns < _COLUMNS) & (rows >= 0) & (numbers <= _LAST_TILE)
        homes = np.unique(numbers[inside & has_area])
        crossing = (np.floor(least) < np.floor(greatest)).any(axis=1)
        return cls(
            homes.astype(int).tolist(),
            int(np.count_nonzero(crossing)),
            int(np.count_nonzero(~inside)),
            least,
            greatest,
        )

    def faces_in(self, number: int) -> BoolArray:
        """(F,) bool: faces that reach into a tile."""
        corner = corner_of_tile(number)
        return np.asarray(((self._least < corner + 1.0) & (self._greatest > corner)).all(axis=1))


def corner_of_tile(number: int) -> FloatArray:
    """(2,) float64: the lower left corner of a tile.

    Examples
    --------
    >>> corner_of_tile(1012).tolist()
    [1.0, 1.0]
    """
    row, column = divmod(number - FIRST_TILE, _COLUMNS)
    return np.array([column, row], dtype=np.float64)
