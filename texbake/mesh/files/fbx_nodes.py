"""The nodes of an FBX file, each with a name, values and children; the reader of binary files.

A node of a binary file, version 5 to 7, little-endian or big-endian, is a header (where it ends,
how many values it has, the bytes of these, its name), its values, and its children up to its end;
from version 7.5 on, the header's numbers have 64 bits. `fbx_ascii` reads files of text.

Based on: A. Gessler and C. Kerl, "FBX binary file format specification", Blender developers' blog,
2013.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike
from texbake.mesh.files.source import ByteArray, Cursor, decode_name

# Nodes whose children are never used, and are skipped, however many there are.
UNREAD_NODES = frozenset({
    "AnimationCurve", "AnimationCurveNode", "AnimationLayer", "AnimationStack", "Control",
    "CollectionExclusive", "Deformer", "Document", "Documents", "FBXHeaderExtension",
    "NodeAttribute", "Pose", "References", "Shape", "Takes", "Thumbnail",
})  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class LazyNumbers:
    """Numbers in the file, (n,) once `load` converts them."""

    load: Callable[[], npt.NDArray[Any]]


@dataclass(slots=True)
class Node:
    """A node of the file."""

    name: str
    # Int, float, bytes (text as it stands in the file) or `LazyNumbers`.
    values: list[Any] = field(default_factory=list)
    children: list[Node] = field(default_factory=list)

    def child(self, name: str) -> Node | None:
        """Return the first child of a name."""
        return next((child for child in self.children if child.name == name), None)

    def named(self, name: str) -> list[Node]:
        """Return all children of a name."""
        return [child for child in self.children if child.name == name]

    def text(self, index: int = 0) -> str:
        """Return a value as text; empty where it is none."""
        value = self.values[index] if index < len(self.values) else b""
        return decode_name(value) if isinstance(value, bytes) else ""

    def child_text(self, name: str) -> str:
        """Return the text of a child; empty where there is none."""
        child = self.child(name)
        return "" if child is None else child.text()

    def numbers(self, name: str) -> npt.NDArray[Any]:
        """(n,) numbers of a child, or of its child `a`, as text files have it; none where none."""
        child = self.child(name)
        if child is None:
            return np.zeros(0)
        inner = child.child("a")
        parts = [
            value.load() if isinstance(value, LazyNumbers) else np.array([value])
            for value in (child if inner is None else inner).values
            if not isinstance(value, bytes)
        ]
        if len(parts) == 1:
            return np.asarray(parts[0])
        return np.concatenate(parts) if parts else np.zeros(0)


class Budget:
    """Bytes of numbers that a file may still ask for; what it may grow to follows its size.

    A file whose numbers pack so well that they are more than this counts as an attack.
    """

    def __init__(self, path: PathLike, n_bytes: int) -> None:
        self.path = path
        self.left = max(256 << 20, 64 * n_bytes)

    def take(self, n_bytes: int) -> None:
        """Count bytes, and raise `FileFormatError` where the file asks for too many."""
        self.left -= n_bytes
        if self.left < 0:
            raise FileFormatError(
                f"{self.path}: its arrays unpack to far more than its size; export it again"
            )


MAGIC = b"Kaydara FBX Binary  \0\x1a"
# Kinds of single values, and of arrays, by their codes.
_SINGLE = {"C": "i1", "B": "i1", "Z": "i1", "Y": "i2", "I": "i4", "F": "f4", "D": "f8", "L": "i8"}
_MANY = {"f": "f4", "d": "f8", "i": "i4", "l": "i8", "b": "i1", "c": "i1"}
_LONG_LIST = 8  # from this many values on, a list of one kind is read as an array


def read_binary(path: PathLike, data: ByteArray) -> tuple[Node, int]:
    """Nodes of a binary FBX file, as children of a node without a name, and a version like 7400."""
    reader = _Reader(path, data)
    return reader.read(), reader.version


class _Reader:
    """Bytes of a file and how to read them."""

    def __init__(self, path: PathLike, data: ByteArray) -> None:
        self.cursor = Cursor(path, data)
        if self.cursor.take(len(MAGIC) + 1)[-1] == 1:
            self.cursor.order = ">"
        (self.version,) = self.cursor.unpack("I")
        # End, number of values, bytes of values, length of the name.
        self.header = "QQQB" if self.version >= 7500 else "IIIB"
        self.budget = Budget(path, len(data))

    def read(self) -> Node:
        """Find all nodes."""
        root = Node("")
        cursor = self.cursor
        open_nodes = [(root, len(cursor.data))]
        while open_nodes:
            parent, cursor.stop = open_nodes[-1]
            if cursor.at == cursor.stop and parent is not root:
                open_nodes.pop()
                continue
            node, stop = self._node()
            if node is None:  # the record of zeros that ends a list
                cursor.at = cursor.stop
                open_nodes.pop()
                continue
            parent.children.append(node)
            if cursor.at < stop and node.name not in UNREAD_NODES:
                open_nodes.append((node, stop))
            else:
                cursor.at = stop
        return root

    def _node(self) -> tuple[Node | None, int]:
        """Return the next node without its children, and where they end."""
        cursor = self.cursor
        stop, n_values, n_bytes, n_name = cursor.unpack(self.header)
        if stop == 0:
            return None, 0
        name = decode_name(cursor.take(n_name).tobytes())
        first = cursor.at
        if not first <= first + n_bytes <= stop <= cursor.stop:
            cursor.fail("a node has a wrong length")
        node = Node(name)
        if name not in UNREAD_NODES or n_bytes < 1024:
            cursor.stop = first + n_bytes
            node.values = self._values(n_values)
        cursor.at = first + n_bytes
        return node, stop

    def _values(self, n_values: int) -> list[Any]:
        """Values of a node."""
        if n_values > _LONG_LIST and (run := self._run(n_values)) is not None:
            return [run]
        return [self._value() for _ in range(n_values)]

    def _run(self, n_values: int) -> LazyNumbers | None:
        """Return a long list of numbers of one kind, as files before version 7 have it."""
        rest = self.cursor.data[self.cursor.at : self.cursor.stop]
        kind = _SINGLE.get(chr(rest[0])) if len(rest) else None
        if kind is None:
            return None
        rows = np.dtype([("code", "u1"), ("value", f"{self.cursor.order}{kind}")])
        if n_values * rows.itemsize != len(rest):
            return None
        values = rest.view(rows)
        if (values["code"] != rest[0]).any():
            return None
        return LazyNumbers(partial(_native, values["value"]))

    def _value(self) -> Any:
        cursor = self.cursor
        code = chr(cursor.take(1)[0])
        if code in _SINGLE:
            return cursor.array(_SINGLE[code], 1)[0].item()
        if code in "SR":
            return cursor.take(*cursor.unpack("I")).tobytes()
        if code not in _MANY:
            cursor.fail(f"a value has the unknown kind {quoted(code)}")
        count, is_packed, n_bytes = cursor.unpack("III")
        dtype = np.dtype(f"{cursor.order}{_MANY[code]}")
        content = cursor.take(n_bytes if is_packed else count * dtype.itemsize)
        return LazyNumbers(partial(self._array, content, count, dtype, bool(is_packed)))

    def _array(
        self, content: ByteArray, count: int, dtype: np.dtype[Any], is_packed: bool
    ) -> npt.NDArray[Any]:
        """(count,) numbers of bytes that may be deflated."""
        wanted = count * dtype.itemsize
        self.budget.take(wanted)
        if is_packed:
            try:
                # One byte more, so that an array that is too long shows.
                found = zlib.decompressobj().decompress(content.tobytes(), wanted + 1)
            except zlib.error:
                found = b""
            if len(found) != wanted:
                raise FileFormatError(f"{self.cursor.path}: an array of {count} numbers is damaged")
            content = np.frombuffer(found, np.uint8)
        return _native(content.view(dtype))


def _native(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return values.astype(values.dtype.newbyteorder("="), copy=False)
