"""The nodes of an FBX file, binary or text, each with a name, values and children.

A node of a binary file, version 5 to 7, little-endian or big-endian, is a header (where it ends,
how many values it has, the bytes of these, its name), its values, and its children up to its end;
from version 7.5 on, the header's numbers have 64 bits.

Text is `Name: value, value {` children `}`, with comments from `;` to the line's end. Values are
numbers, texts in quotation marks (with `&quot;` for one within), words without (T, Y, W), and from
version 7 on arrays, `*count { a: 1,2,3 }`. Long lists of numbers are kept as text until they are
read.

Based on: A. Gessler and C. Kerl, "FBX binary file format specification", Blender developers' blog,
2013.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike
from texbake.mesh.files.source import Cursor, decode_name, line_number, parse_numbers, text_of
from texbake.mesh.mesh import ByteArray, FloatArray

# Nodes whose children are never used, and are skipped, however many there are.
UNREAD_NODES = frozenset({
    "AnimationStack", "Control", "CollectionExclusive",
    "Document", "Documents", "FBXHeaderExtension", "Pose", "References", "Takes",
    "Thumbnail",
})  # fmt: skip


# Returns (n,) numbers of the file, converted.
LazyNumbers = Callable[[], npt.NDArray[Any]]


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
            value() if callable(value) else np.array([value])
            for value in (child if inner is None else inner).values
            if not isinstance(value, bytes)
        ]
        if len(parts) == 1:
            return np.asarray(parts[0])
        return np.concatenate(parts) if parts else np.zeros(0)


def read_nodes(path: PathLike, data: ByteArray) -> tuple[Node, int]:
    """Nodes of an FBX file below one without a name, and a version like 7400, 0 if unknown."""
    if data[: len(_MAGIC)].tobytes() == _MAGIC:
        binary = _BinaryReader(path, data)
        return binary.read(), binary.version
    data = text_of(path, data, "an FBX file")
    head = data[:4096].tobytes()
    if b"FBX" not in head.upper():
        raise FileFormatError(f"{path}: it is not an FBX file; neither binary nor text")
    number, words = _VERSION_NUMBER.search(head), _VERSION_WORDS.search(head)
    version = 1000 * int(words[1]) + 100 * int(words[2]) if words else 0
    return _TextReader(path, data).read(), int(number[1]) if number else version


_MAGIC = b"Kaydara FBX Binary  \0\x1a"
# Kinds of single values, and of arrays, by their codes.
_SINGLE = {"C": "i1", "B": "i1", "Z": "i1", "Y": "i2", "I": "i4", "F": "f4", "D": "f8", "L": "i8"}
_MANY = {"f": "f4", "d": "f8", "i": "i4", "l": "i8", "b": "i1", "c": "i1"}
_LONG_LIST = 8  # from this many values on, a list of one kind is read as an array


class _BinaryReader:
    """Bytes of a file and how to read them."""

    def __init__(self, path: PathLike, data: ByteArray) -> None:
        self.cursor = Cursor(path, data)
        if self.cursor.take(len(_MAGIC) + 1)[-1] == 1:
            self.cursor.order = ">"
        (self.version,) = self.cursor.unpack("I")
        # End, number of values, bytes of values, length of the name.
        self.header = "QQQB" if self.version >= 7500 else "IIIB"
        # Bytes that its arrays may still unpack to; more than this counts as an attack.
        self.left = max(256 << 20, 64 * len(data))

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
            run = self._run(n_values) if n_values > _LONG_LIST else None
            node.values = [self._value() for _ in range(n_values)] if run is None else [run]
        cursor.at = first + n_bytes
        return node, stop

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
        return partial(_native, values["value"])

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
        return partial(self._array, content, count, dtype, bool(is_packed))

    def _array(
        self, content: ByteArray, count: int, dtype: np.dtype[Any], is_packed: bool
    ) -> npt.NDArray[Any]:
        """(count,) numbers of bytes that may be deflated."""
        wanted = count * dtype.itemsize
        self.left -= wanted
        if self.left < 0:
            raise FileFormatError(
                f"{self.cursor.path}: its arrays unpack to far more than its size; export it again"
            )
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


_BLANK = re.compile(rb"(?:[\s,]|;[^\n]*)*+")
_NAME = re.compile(rb"([A-Za-z_][\w| .\-]*?)[ \t]*:(?!:)")
_NUMBERS = re.compile(rb"[-+.\d][-+.,\d\seE]*+")
# Infinities and NaN, as C libraries write them: -inf, nan(ind), 1.#INF, -1.#QNAN0. A run of
# numbers ends before the letters, and may include the digits in front of them.
_NOT_FINITE = re.compile(
    rb"[-+]?(?:\d+\.#)?#?(?:inf|nan|ind|qnan|snan)\w*+(?:\(\w*+\))?", re.IGNORECASE
)
_VALUE = re.compile(rb'"([^"]*+)"|\*[ \t]*(\d+)|([A-Za-z_#][\w#.+\-]*)')
_BEGUN = re.compile(rb"(?:[-+]|[-+]?\d+\.)\Z")
_BETWEEN = re.compile(rb"[^{}\";]*+")
_VERSION_NUMBER = re.compile(rb"FBXVersion:\s*(\d{4})\b")
_VERSION_WORDS = re.compile(rb";\s*FBX\s+(\d)\.(\d)")
_INT64 = 1 << 63
_LONG = 256  # bytes from which on numbers are kept as text


class _TextReader:
    """Text of a file and how far it is read."""

    def __init__(self, path: PathLike, data: ByteArray) -> None:
        self.path, self.data = path, data
        self.text = data.tobytes()
        self.at = 0

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError`."""
        line = line_number(self.data, self.at)
        raise FileFormatError(f"{self.path}: line {line}: {what}; export it again")

    def read(self) -> Node:
        """Find all nodes."""
        root = Node("")
        open_nodes = [root]
        while self._skip_blank():
            if self.text[self.at] == ord("}"):
                self.at += 1
                if len(open_nodes) == 1:
                    self.fail("a } closes no node")
                open_nodes.pop()
                continue
            node = self._node()
            open_nodes[-1].children.append(node)
            if not self._skip_blank() or self.text[self.at] != ord("{"):
                continue
            self.at += 1
            if node.name in UNREAD_NODES:
                self._skip_node()
                continue
            open_nodes.append(node)
        if len(open_nodes) > 1:
            self.fail(f"it ends within {quoted(open_nodes[-1].name)}")
        return root

    def _skip_blank(self) -> bool:
        """Skip what says nothing; return whether anything follows."""
        match = _BLANK.match(self.text, self.at)
        assert match is not None
        self.at = match.end()
        return self.at < len(self.text)

    def _node(self) -> Node:
        """Return a node with its values."""
        match = _NAME.match(self.text, self.at)
        if match is None:
            found = self.text[self.at : self.at + 20].decode("latin-1")
            self.fail(f"{quoted(found.splitlines()[0])} stands where a node belongs")
        self.at = match.end()
        node = Node(match[1].decode("latin-1"))
        while (value := self._value()) is not None:
            node.values += value
        return node

    def _value(self) -> list[Any] | None:
        """Return the next value or values, or None where the list ends."""
        self._skip_blank()
        numbers = _NUMBERS.match(self.text, self.at)
        if numbers is not None:
            # An E behind a blank begins the name of the next node.
            words = numbers[0].rstrip(b"eE")
            begun = _BEGUN.search(words)
            if begun and _NOT_FINITE.match(self.text, self.at + begun.start()):
                words = words[: begun.start()]
            self.at += len(words)
            if words:
                return self._numbers(words)
        if _NAME.match(self.text, self.at):
            return None
        not_finite = _NOT_FINITE.match(self.text, self.at)
        if not_finite is not None:
            self.at = not_finite.end()
            return [math.nan]
        match = _VALUE.match(self.text, self.at)
        if match is None:
            return None
        self.at = match.end()
        if match[1] is not None:
            return [match[1].replace(b"&quot;", b'"')]
        if match[2] is not None:
            return []  # the array itself follows in braces
        return [match[3]]

    def _numbers(self, words: bytes) -> list[Any]:
        """Numbers of a text with commas and blanks."""
        if len(words) > _LONG:
            return [partial(self._long_list, self.at - len(words), self.at)]
        try:
            return [_number(word) for word in words.replace(b",", b" ").split()]
        except ValueError:
            self.fail(f"{quoted(words[:20].decode('latin-1').splitlines()[0])} is not a number")

    def _long_list(self, start: int, stop: int) -> FloatArray:
        """(n,) numbers of the text between two places."""
        return parse_numbers(self.path, self._spaced, start, stop).values

    @cached_property
    def _spaced(self) -> ByteArray:
        """The text with blanks for commas."""
        return np.where(self.data == ord(","), np.uint8(ord(" ")), self.data)

    def _skip_node(self) -> None:
        """Skip to behind the brace that closes the one before."""
        depth = 1
        while depth:
            match = _BETWEEN.match(self.text, self.at)
            assert match is not None
            self.at = match.end() + 1
            mark = self.text[match.end() : self.at]
            if not mark:
                self.fail("it ends within a node")
            if mark in b'";':
                end = self.text.find(b'"' if mark == b'"' else b"\n", self.at)
                self.at = len(self.text) if end < 0 else end + 1
            else:
                depth += 1 if mark == b"{" else -1


def _number(word: bytes) -> int | float:
    try:
        whole = int(word)
    except ValueError:
        return float(word)
    return whole if -_INT64 <= whole < _INT64 else float(word)
