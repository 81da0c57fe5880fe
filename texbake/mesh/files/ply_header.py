"""The header of a PLY file: its elements and their properties, and how their rows lie in the body.

Based on: G. Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.source import ByteArray

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
    """A value of each row of an element, or, with a `count_type`, a list of values.

    Types are numpy's codes, without byte order.
    """

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
    """What the header says; the body begins at offset `end`.

    `order` is numpy's sign of the byte order, empty for a body of text.
    """

    order: str
    elements: tuple[Element, ...]
    end: int


def read_header(path: PathLike, data: ByteArray) -> Header:
    """Read the header, which ends with the line ``end_header``.

    Raises
    ------
    FileFormatError
        The file is not a PLY file, or its header breaks the rules.
    """
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
    elements: list[Element] = []
    for number, line in enumerate(lines, start=2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, _] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(Element(name, int(count), ()))
            case ["property", "list", count_type, value_type, name] if (
                elements and TYPES.get(count_type, "f")[0] in "iu" and value_type in TYPES
            ):
                _append(elements, Property(name, TYPES[value_type], TYPES[count_type]))
            case ["property", value_type, name] if elements and value_type in TYPES:
                _append(elements, Property(name, TYPES[value_type]))
            case _:
                raise FileFormatError(
                    f"{path}: line {number}: {line[:60]!r} is no statement of a PLY header"
                )
    return order, tuple(elements)


def _append(elements: list[Element], prop: Property) -> None:
    last = elements[-1]
    elements[-1] = Element(last.name, last.n_rows, (*last.properties, prop))
