"""Binary FBX to nodes, versions 5 to 7, little-endian or big-endian.

A node is a header (where it ends, how many values it has, the bytes of these, its name), its
values, and its children up to its end; from version 7.5 on, the header's numbers have 64 bits.
Every length is checked against what encloses it, and nodes are found in a loop, not by recursion.

Based on: A. Gessler and C. Kerl, "FBX binary file format specification", Blender developers' blog,
2013.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike
from texbake.mesh.files.fbx_nodes import MAX_DEPTH, MAX_NODES, PASSED_OVER, Budget, Node
from texbake.mesh.files.source import ByteArray, decode_name

MAGIC = b"Kaydara FBX Binary  \0\x1a"
_FIRST_NODE = 27
# Kinds of single values, and of arrays, by their codes.
_SINGLE = {"C": "i1", "B": "i1", "Z": "i1", "Y": "i2", "I": "i4", "F": "f4", "D": "f8", "L": "i8"}
_MANY = {"f": "f4", "d": "f8", "i": "i4", "l": "i8", "b": "i1", "c": "i1"}
_DEFLATE_RATIO = 1100  # deflate packs no better than 1,032 to 1
_LONG_LIST = 8  # from this many values on, a list of one kind is read as an array


def read_binary(path: PathLike, data: ByteArray) -> Node:
    """Nodes of a binary FBX file, as children of a node without a name."""
    return _Reader(path, data).read()


def binary_version(data: ByteArray) -> int:
    """Return the version in the header of a binary FBX file, such as 7400."""
    (version,) = struct.unpack_from(f"{_byte_order(data)}I", data.data, 23)
    return int(version)


def _byte_order(data: ByteArray) -> str:
    return ">" if data[22] == 1 else "<"


class _Reader:
    """Bytes of a file and how to read them."""

    def __init__(self, path: PathLike, data: ByteArray) -> None:
        self.path = path
        self.data = data
        if len(data) < _FIRST_NODE:
            self.fail(len(data), "it ends within its header")
        self.order = _byte_order(data)
        version = binary_version(data)
        # End, number of values, bytes of values, length of the name.
        self.header = struct.Struct(f"{self.order}{'QQQB' if version >= 7500 else 'IIIB'}")
        self.budget = Budget(path, len(data))

    def fail(self, at: int, what: str) -> None:
        """Raise `FileFormatError`."""
        raise FileFormatError(f"{self.path}: byte {at}: {what}; export it again")

    def read(self) -> Node:
        """Find all nodes."""
        root = Node("")
        open_nodes = [(root, len(self.data))]
        at = _FIRST_NODE
        n_nodes = 0
        while open_nodes:
            parent, end = open_nodes[-1]
            if at == end and parent is not root:
                open_nodes.pop()
                continue
            node, after, stop = self._node(at, end)
            if node is None:  # the record of zeros that ends a list
                at = end
                open_nodes.pop()
                continue
            n_nodes += 1
            if n_nodes > MAX_NODES:
                self.fail(at, f"it has more than {MAX_NODES} nodes")
            parent.children.append(node)
            at = stop
            if after < stop and node.name not in PASSED_OVER:
                if len(open_nodes) > MAX_DEPTH:
                    self.fail(after, f"its nodes are more than {MAX_DEPTH} levels deep")
                open_nodes.append((node, stop))
                at = after
        return root

    def _node(self, at: int, end: int) -> tuple[Node | None, int, int]:
        """Return a node without children, where its values end, and where it ends."""
        if at + self.header.size > end:
            self.fail(at, "a node is cut off")
        stop, n_values, n_bytes, n_name = self.header.unpack_from(self.data.data, at)
        if stop == 0:
            return None, at, end
        first = at + self.header.size + n_name
        if not first <= first + n_bytes <= stop <= end:
            self.fail(at, "a node has a wrong length")
        name = decode_name(self.data[first - n_name : first].tobytes())
        node = Node(name)
        if name not in PASSED_OVER or n_bytes < 1024:
            node.values = self._values(first, first + n_bytes, n_values)
        return node, first + n_bytes, stop

    def _values(self, at: int, end: int, n_values: int) -> list[Any]:
        """Values of a node."""
        if n_values > _LONG_LIST and (run := self._run(at, end, n_values)) is not None:
            return [run]
        values = []
        for _ in range(n_values):
            if at >= end:
                self.fail(at, "a node has fewer values than it says")
            value, at = self._value(at, end)
            values.append(value)
        return values

    def _run(self, at: int, end: int, n_values: int) -> _Run | None:
        """Return a long list of numbers of one kind, as files before version 7 have it."""
        kind = _SINGLE.get(chr(self.data[at])) if at < end else None
        if kind is None:
            return None
        rows = np.dtype([("code", "u1"), ("value", f"{self.order}{kind}")])
        if n_values * rows.itemsize != end - at:
            return None
        values = self.data[at:end].view(rows)
        return _Run(values["value"]) if (values["code"] == self.data[at]).all() else None

    def _value(self, at: int, end: int) -> tuple[Any, int]:
        """Return a value and where the next begins."""
        code = chr(self.data[at])
        at += 1
        if code in _SINGLE:
            kind = np.dtype(f"{self.order}{_SINGLE[code]}")
            if at + kind.itemsize > end:
                self.fail(at, "a value is cut off")
            return self.data[at : at + kind.itemsize].view(kind)[0].item(), at + kind.itemsize
        if code in "SR":
            (length,) = self._unpack("I", at, end)
            if at + 4 + length > end:
                self.fail(at, "a text has a wrong length")
            return self.data[at + 4 : at + 4 + length].tobytes(), at + 4 + length
        if code in _MANY:
            return self._array(_MANY[code], at, end)
        self.fail(at - 1, f"a value has the unknown kind {quoted(code)}")
        raise AssertionError

    def _unpack(self, kinds: str, at: int, end: int) -> tuple[int, ...]:
        layout = struct.Struct(f"{self.order}{kinds}")
        if at + layout.size > end:
            self.fail(at, "a value is cut off")
        return layout.unpack_from(self.data.data, at)

    def _array(self, kind: str, at: int, end: int) -> tuple[Any, int]:
        count, is_packed, n_bytes = self._unpack("III", at, end)
        dtype = np.dtype(f"{self.order}{kind}")
        at += 12
        wanted = count * dtype.itemsize
        stop = at + (n_bytes if is_packed else wanted)
        if stop > end:
            self.fail(at, "an array has a wrong length")
        if is_packed and wanted > _DEFLATE_RATIO * n_bytes:
            self.fail(at, f"an array says {count} numbers, and {n_bytes} bytes cannot hold them")
        return _Packed(self, at, stop, count, dtype, bool(is_packed)), stop


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """Numbers that stand one by one."""

    values: npt.NDArray[Any]

    def load(self) -> npt.NDArray[Any]:
        """(n,) numbers."""
        return self.values.astype(self.values.dtype.newbyteorder("="))


@dataclass(frozen=True, slots=True, eq=False)
class _Packed:
    """An array from one byte of the file to another, perhaps deflated."""

    reader: _Reader
    at: int
    stop: int
    count: int
    dtype: np.dtype[Any]
    is_packed: bool

    def load(self) -> npt.NDArray[Any]:
        """(n,) numbers."""
        content = self.reader.data[self.at : self.stop]
        wanted = self.count * self.dtype.itemsize
        self.reader.budget.take(wanted)
        if self.is_packed:
            content = np.frombuffer(self._inflated(content, wanted), np.uint8)
        return content.view(self.dtype).astype(self.dtype.newbyteorder("="), copy=False)

    def _inflated(self, content: ByteArray, wanted: int) -> bytes:
        try:
            # One byte more, so that an array that is too long shows.
            found = zlib.decompressobj().decompress(content.tobytes(), wanted + 1)
        except zlib.error:
            found = b""
        if len(found) != wanted:
            self.reader.fail(self.at, f"an array of {self.count} numbers is damaged")
        return found
