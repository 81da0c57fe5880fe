"""The rows of an element of a PLY file, as columns.

A body of text is given as the float64 numbers in it, so that every value takes one unit of the
body; in a binary body the unit is a byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.kernels import kernel
from texbake.mesh.files.ply_header import Element


@dataclass(frozen=True)
class Ragged:
    """Lists of several lengths: how long each is, and all values after each other."""

    sizes: npt.NDArray[np.int64]
    values: npt.NDArray[Any]


# A scalar property is (n,), a list property whose lists all have k values is (n, k).
Columns = dict[str, npt.NDArray[Any] | Ragged]


def read_element(
    path: PathLike, body: npt.NDArray[Any], start: int, element: Element, order: str
) -> tuple[Columns, int]:
    """Columns of the element whose rows begin at a unit of the body, and where they end.

    Where all rows have one size the columns are views of the body, else copies.

    Raises
    ------
    FileFormatError
        The body is shorter than the element, or a list has a negative length.
    """
    text = body.dtype.kind == "f"
    least = element.n_rows * (len(element.properties) if text else element.least_row_size)
    if least > len(body) - start:  # asked before anything is allocated
        raise FileFormatError(
            f"{path}: its header promises {element.n_rows} rows of '{element.name}', for which "
            f"the file is too short; it is truncated or damaged"
        )
    if not element.properties:
        return {}, start
    return _uniform_columns(body, start, element, order) or _ragged_columns(
        path, body, start, element, order
    )


def _units(code: str, body: npt.NDArray[Any]) -> int:
    return 1 if body.dtype.kind == "f" else int(code[1])


def _dtype(code: str, order: str) -> np.dtype[Any]:
    return np.dtype(order + code if order else "f8")


def _uniform_columns(
    body: npt.NDArray[Any], start: int, element: Element, order: str
) -> tuple[Columns, int] | None:
    """Views of the body, if every row's lists are as long as those of the first row."""
    at = start
    places: list[tuple[str, int, str, int | None]] = []  # name, unit, type, length of the list
    counts: list[tuple[int, str, int]] = []  # unit, type, length
    for prop in element.properties:
        length = None
        if prop.count_type is not None:
            if at + _units(prop.count_type, body) > len(body):
                return None
            count = _view(body, at, _dtype(prop.count_type, order), 1, 0)[0]
            if not 0 <= count <= len(body):
                return None
            length = int(count)
            counts.append((at, prop.count_type, length))
            at += _units(prop.count_type, body)
        places.append((prop.name, at, prop.type, length))
        at += _units(prop.type, body) * (1 if length is None else length)
    n_rows, row_size = element.n_rows, at - start
    if n_rows * row_size > len(body) - start:
        return None
    for at, code, length in counts:
        if (_view(body, at, _dtype(code, order), n_rows, row_size) != length).any():
            return None
    columns: Columns = {
        name: _view(body, at, _dtype(code, order), n_rows, row_size, length)
        for name, at, code, length in places
    }
    return columns, start + n_rows * row_size


def _view(
    body: npt.NDArray[Any],
    start: int,
    dtype: np.dtype[Any],
    n_rows: int,
    row_size: int,
    length: int | None = None,
) -> npt.NDArray[Any]:
    """(n_rows,) or (n_rows, length) values, one row `row_size` units behind the other."""
    shape = (n_rows,) if length is None else (n_rows, length)
    strides = (row_size * body.itemsize, dtype.itemsize)[: len(shape)]
    return np.ndarray(shape, dtype, buffer=body.data, offset=start * body.itemsize, strides=strides)


def _ragged_columns(
    path: PathLike, body: npt.NDArray[Any], start: int, element: Element, order: str
) -> tuple[Columns, int]:
    """Copies, made by walking the rows one after the other."""
    text = body.dtype.kind == "f"
    layout = np.array(
        [
            (
                _units(prop.count_type, body) if prop.count_type else 0,
                not text and prop.count_type is not None and prop.count_type[0] == "i",
                _units(prop.type, body),
            )
            for prop in element.properties
        ],
        dtype=np.int64,
    )
    offsets = np.empty((len(layout), element.n_rows), dtype=np.int64)
    sizes = np.empty_like(offsets)
    failed, end = _walk_kernel(body, start, layout, order == ">", offsets, sizes)
    if failed >= 0:
        raise FileFormatError(
            f"{path}: row {failed} of '{element.name}' does not end within the file; "
            f"it is truncated or damaged"
        )
    columns: Columns = {}
    for column, prop in enumerate(element.properties):
        units = np.empty(int(sizes[column].sum()) * int(layout[column, 2]), dtype=body.dtype)
        _gather_kernel(body, offsets[column], sizes[column] * layout[column, 2], units)
        values = units.view(_dtype(prop.type, order))
        columns[prop.name] = values if prop.count_type is None else Ragged(sizes[column], values)
    return columns, end


@kernel
def _walk_kernel(body, at, layout, big_endian, offsets, sizes):  # type: ignore[no-untyped-def]
    """Find the units and number of values of each property of each row.

    `layout` holds, for each property, the units of its count (0: no list), whether the count has a
    sign, and the units of a value. Returns the row that does not fit, or -1, and the end.
    """
    for row in range(offsets.shape[1]):
        for column in range(len(layout)):
            count_size = layout[column, 0]
            n_values = np.int64(1)
            if count_size > 0:
                if count_size > len(body) - at:
                    return row, at
                n_values = np.int64(0)
                for i in range(count_size):
                    byte = body[at + (i if big_endian else count_size - 1 - i)]
                    n_values = n_values * 256 + np.int64(byte)
                if layout[column, 1] and n_values >> (8 * count_size - 1):
                    return row, at
                at += count_size
            if n_values < 0 or n_values > (len(body) - at) // layout[column, 2]:
                return row, at
            offsets[column, row] = at
            sizes[column, row] = n_values
            at += n_values * layout[column, 2]
    return -1, at


@kernel
def _gather_kernel(body, offsets, lengths, units):  # type: ignore[no-untyped-def]
    """Copy the pieces of the body after each other."""
    slot = 0
    for row in range(len(offsets)):
        for unit in range(offsets[row], offsets[row] + lengths[row]):
            units[slot] = body[unit]
            slot += 1
