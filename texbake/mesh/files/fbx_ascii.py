"""FBX text to nodes: `Name: value, value {` children `}`, with comments from `;` to the line's end.

Values are numbers, texts in quotation marks (with `&quot;` for one within), words without (T, Y,
W), and from version 7 on arrays, `*count { a: 1,2,3 }`. Long lists of numbers are kept as text
until they are asked for.
"""

from __future__ import annotations

import math
import re
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike
from texbake.mesh.files.decimals import parse_numbers
from texbake.mesh.files.fbx_nodes import UNREAD_NODES, Budget, LazyNumbers, Node
from texbake.mesh.files.source import ByteArray, line_number, text_of
from texbake.mesh.mesh import FloatArray

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


def read_ascii(path: PathLike, data: ByteArray) -> tuple[Node, int]:
    """Nodes of an FBX text file, as children of a node without a name, and a version like 7400.

    The version is 0 where the file does not say it.
    """
    data = text_of(path, data, "an FBX file")
    head = data[:4096].tobytes()
    if b"FBX" not in head.upper():
        raise FileFormatError(f"{path}: it is not an FBX file; neither binary nor text")
    number, words = _VERSION_NUMBER.search(head), _VERSION_WORDS.search(head)
    version = 1000 * int(words[1]) + 100 * int(words[2]) if words else 0
    return _Reader(path, data).read(), int(number[1]) if number else version


class _Reader:
    """Text of a file and how far it is read."""

    def __init__(self, path: PathLike, data: ByteArray) -> None:
        self.path, self.data = path, data
        self.text = data.tobytes()
        self.at = 0
        self.budget = Budget(path, len(data))

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
            stop = self.at
            return [LazyNumbers(lambda: self._long_list(stop - len(words), stop))]
        try:
            return [_number(word) for word in words.replace(b",", b" ").split()]
        except ValueError:
            self.fail(f"{quoted(words[:20].decode('latin-1').splitlines()[0])} is not a number")

    def _long_list(self, start: int, stop: int) -> FloatArray:
        """(n,) numbers of the text between two places."""
        self.budget.take(4 * (stop - start))
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
