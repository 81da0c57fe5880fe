"""Read the tables of a PLY file, described by its header, as columns.

An ASCII body is passed as an array of its numbers in float64, so that every value takes one unit of
the body. In a binary body, the unit is a byte. Kernel: `core/ply_rows.c`.

Based on: G. Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from texbake.core import core
from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike
from texbake.limits import whole_number
from texbake.mesh.mesh import AnyArray, ByteArray, Int64Array
from texbake.records import dataclass

# numpy's code of each type, without byte order.
TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1"},
    **{"short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2"},
    **{"int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 1 << 20  # bytes; a header takes some hundreds


@dataclass(frozen=True)
class Property:
    """A value, or with a `count_type` a list of values, of each row; types are numpy's codes."""

    name: str
    type: str
    count_type: str | None = None

    @property
    def least_size(self) -> int:
        """Bytes that it takes in a row, at least."""
        return int((self.count_type or self.type)[1])


@dataclass(frozen=True)
class Element:
    """A table of rows, such as the vertices."""

    name: str
    n_rows: int
    properties: tuple[Property, ...]

    @property
    def least_row_size(self) -> int:
        """Bytes of a row whose lists are empty."""
        return sum(prop.least_size for prop in self.properties)


@dataclass(frozen=True)
class Header:
    """What the header says: numpy's byte order, empty for text, and where the body begins."""

    order: str
    elements: tuple[Element, ...]
    end: int


def read_header(path: PathLike, data: ByteArray) -> Header:
    """Read the header, which ends with the line ``end_header``."""
    text = data[:_MAX_HEADER].tobytes()
    if text[:3] != b"ply" or text[3:4] not in (b"\n", b"\r"):
        raise FileFormatError(f"{path}: it is not a PLY file; it does not begin with 'ply'")
    # The line end that the first line has; a body may begin with the bytes of another.
    line_end = b"\n" if text[3:4] == b"\n" else b"\r\n" if text[4:5] == b"\n" else b"\r"
    stop = text.find(line_end + b"end_header")
    end = text.find(line_end, stop + 1) if stop >= 0 else -1
    if stop < 0 or (end < 0 and len(text) > stop + len(line_end) + len(b"end_header")):
        raise FileFormatError(f"{path}: its header has no end; the file is truncated or damaged")
    end = end + len(line_end) if end >= 0 else len(text)
    order, elements = _read_statements(path, text[:stop].decode("latin-1").splitlines()[1:])
    if order is None:
        raise FileFormatError(f"{path}: its header has no format line")
    return Header(order, elements, end)


def _read_statements(path: PathLike, lines: list[str]) -> tuple[str | None, tuple[Element, ...]]:
    order = None
    elements: list[tuple[str, int, list[Property]]] = []
    for number, line in enumerate(lines, start=2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, _] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, text] if (count := whole_number(text)) is not None:
                elements.append((name, count, []))
            case ["property", "list", count_type, value_type, name] if (
                elements and TYPES.get(count_type, "f")[0] in "iu" and value_type in TYPES
            ):
                elements[-1][2].append(Property(name, TYPES[value_type], TYPES[count_type]))
            case ["property", value_type, name] if elements and value_type in TYPES:
                elements[-1][2].append(Property(name, TYPES[value_type]))
            case _:
                raise FileFormatError(
                    f"{path}: line {number}: {quoted(line)} is not a statement of a PLY header"
                )
    return order, tuple(Element(name, count, tuple(found)) for name, count, found in elements)


@dataclass(frozen=True)
class ListColumn:
    """Lists of several lengths: how long each is, and all values after each other."""

    sizes: Int64Array
    values: AnyArray


# A scalar property is (n,), a list property whose lists all have k values is (n, k).
Columns = dict[str, AnyArray | ListColumn]


def read_element(
    path: PathLike, body: AnyArray, start: int, element: Element, order: str, *, first_row: int = 0
) -> tuple[Columns, int]:
    """Columns of an element, views where rows have one size, and the unit where they end."""
    require_rows(path, body, start, element)  # before anything is allocated
    if not element.properties:
        return {}, start
    return _uniform_columns(body, start, element, order) or _list_columns(
        path, body, start, element, order, first_row
    )


def require_rows(path: PathLike, body: AnyArray, start: int, element: Element) -> None:
    """Raise `FileFormatError` if the body is too short for the rows of an element."""
    text = body.dtype.kind == "f"
    least = element.n_rows * (len(element.properties) if text else element.least_row_size)
    if least > len(body) - start:
        raise FileFormatError(
            f"{path}: its header promises {element.n_rows} rows of '{element.name}', for which "
            f"the file is too short; it is truncated or damaged"
        )


def _dtype(code: str, order: str) -> np.dtype[Any]:
    return np.dtype(order + code if order else "f8")


def _uniform_columns(
    body: AnyArray, start: int, element: Element, order: str
) -> tuple[Columns, int] | None:
    """Views of the body, if every row's lists are as long as those of the first row."""
    data, first = body.view(np.uint8), start * body.itemsize
    row: list[tuple[str, Any, tuple[int, ...]]] = []  # fields; properties may have equal names
    lengths: dict[str, int] = {}
    at = first
    for number, prop in enumerate(element.properties):
        shape: tuple[int, ...] = ()
        if prop.count_type is not None:
            dtype = _dtype(prop.count_type, order)
            if at + dtype.itemsize > len(data):
                return None
            length = data[at : at + dtype.itemsize].view(dtype)[0]
            if not 0 <= length <= len(data):
                return None
            shape = (int(length),)
            row.append((f"length {number}", dtype, ()))
            lengths[f"length {number}"] = int(length)
            at += dtype.itemsize
        dtype = _dtype(prop.type, order)
        row.append((f"{number}", dtype, shape))
        at += dtype.itemsize * math.prod(shape)
    end = first + element.n_rows * (at - first)
    if max(at, end) > len(data) or at - first >= 1 << 31:  # the most that NumPy has in a row
        return None
    rows = np.ndarray(element.n_rows, np.dtype(row), data, first)
    if any((rows[name] != length).any() for name, length in lengths.items()):
        return None
    columns: Columns = {prop.name: rows[f"{i}"] for i, prop in enumerate(element.properties)}
    return columns, end // body.itemsize


def _list_columns(
    path: PathLike, body: AnyArray, start: int, element: Element, order: str, first_row: int
) -> tuple[Columns, int]:
    """Copies, made by walking the rows one after the other."""
    text = body.dtype.kind == "f"
    layout = np.array(
        [
            (
                _dtype(prop.count_type, order).itemsize // body.itemsize if prop.count_type else 0,
                not text and prop.count_type is not None and prop.count_type[0] == "i",
                _dtype(prop.type, order).itemsize // body.itemsize,
            )
            for prop in element.properties
        ],
        dtype=np.int64,
    )
    offsets = np.empty((len(layout), element.n_rows), dtype=np.int64)
    sizes = np.empty_like(offsets)
    end = np.empty(1, dtype=np.int64)
    if text:
        failed = core.walk_text_rows(body, start, layout, offsets, sizes, end)
    else:
        failed = core.walk_binary_rows(body, start, layout, order == ">", offsets, sizes, end)
    if failed >= 0:
        raise FileFormatError(
            f"{path}: row {first_row + failed} of '{element.name}' does not end within the file; "
            f"it is truncated or damaged"
        )
    columns: Columns = {}
    for column, prop in enumerate(element.properties):
        lengths = sizes[column] * layout[column, 2]
        units = np.empty(int(lengths.sum()), dtype=body.dtype)
        core.gather_pieces(
            body.view(np.uint8), body.itemsize, offsets[column], lengths, units.view(np.uint8)
        )
        values = units.view(_dtype(prop.type, order))
        columns[prop.name] = (
            values if prop.count_type is None else ListColumn(sizes[column], values)
        )
    return columns, int(end[0])
