"""The rows of an element of a PLY file, as columns.

A body of text is given as the float64 numbers in it, so that every value takes one unit of the
body; in a binary body the unit is a byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.ply_header import Element


@dataclass(frozen=True)
class Ragged:
    """Lists of several lengths: how long each is, and all values after each other."""

    sizes: npt.NDArray[np.int64]
    values: npt.NDArray[Any]


# A scalar property is (n,), a list property of one length k is (n, k).
Columns = dict[str, npt.NDArray[Any] | Ragged]


def read_element(
    path: PathLike, body: npt.NDArray[Any], start: int, element: Element, order: str
) -> tuple[Columns, int]:
    """Columns of the element whose rows begin at a unit of the body, and where they end.

    Where all rows have one size, the columns are views of the body.

    Raises
    ------
    FileFormatError
        The body is shorter than the element, or a list has a negative length.
    """
    layout = _layout(element, body)
    # Before anything is allocated: a header may claim anything.
    if element.n_rows * int(layout.max(axis=1, initial=0).clip(max=8) @ _ones(layout)) < 0:
        raise AssertionError
    raise NotImplementedError
