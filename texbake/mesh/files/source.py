"""The bytes of a mesh file, lines and decimal numbers in them, and what a file is parsed into.

Numbers are read and written so that every float64 keeps its bits; kernel: `core/decimals.c`.
"""

from __future__ import annotations

import gc
import io
import math
import os
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import FileFormatError, counted, one_line, quoted, shortened
from texbake.files import PathLike, read_whole
from texbake.limits import LONGEST_NAME
from texbake.mesh.mesh import AnyArray, ByteArray, FloatArray, Int64Array, IntArray

Parsed = TypeVar("Parsed")

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_PARSED: ContextVar[dict[Any, Any] | None] = ContextVar("parsed files", default=None)


def read_array(path: PathLike) -> ByteArray:
    """Read a file as a read-only array, not mapped, since parsers go over it several times."""
    data = read_whole(path, lambda place: np.fromfile(place, dtype=np.uint8))
    data.flags.writeable = False
    return data


class Cursor:
    """A place in a binary file up to `stop`; `order` is the byte order, as in `struct`."""

    def __init__(self, path: PathLike, data: ByteArray, *, order: str = "<") -> None:
        self.path = path
        self.data = data
        self.order = order
        self.at = 0
        self.stop = len(data)

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError` that names the place."""
        raise FileFormatError(f"{self.path}: byte {self.at}: {what}; export it again")

    def take(self, n_bytes: int) -> ByteArray:
        """Return the next bytes."""
        start = self.at
        if not 0 <= n_bytes <= self.stop - start:
            self.fail(f"the file is cut short, or damaged: {n_bytes} bytes are missing here")
        self.at += n_bytes
        return self.data[start : self.at]

    def unpack(self, kinds: str) -> tuple[Any, ...]:
        """Return the next numbers, of the kinds that `struct` names."""
        layout = struct.Struct(self.order + kinds)
        return layout.unpack(self.take(layout.size).data)

    def array(self, kind: str, count: int) -> AnyArray:
        """(count,) next numbers of a kind that NumPy names."""
        dtype = np.dtype(self.order + kind)
        return self.take(count * dtype.itemsize).view(dtype)


@contextmanager
def parsed_once() -> Iterator[None]:
    """Parse each file once in this block, whatever the readers in it ask for."""
    if _PARSED.get() is not None:
        yield
        return
    token = _PARSED.set({})
    try:
        yield
    finally:
        _PARSED.reset(token)


@contextmanager
def without_cycle_search() -> Iterator[None]:
    """Keep Python from searching in this block for cycles, which parsers do not make."""
    was_enabled = gc.isenabled()
    try:
        gc.disable()
        yield
    finally:
        if was_enabled:
            gc.enable()


def parsed(path: PathLike, parse: Callable[[PathLike], Parsed]) -> Parsed:
    """Return what a function makes of a file; in a block of `parsed_once`, the same each time."""
    known = _PARSED.get()
    if known is None:
        return parse(path)
    key = parse, os.fspath(path)
    if key not in known:
        known[key] = parse(path)
    found: Parsed = known[key]
    return found


def text_of(path: PathLike, data: ByteArray, kind: str) -> ByteArray:
    """Return text without a byte-order mark, and without NULs that some programs put at the end."""
    start = len(BYTE_ORDER_MARK) if data[:3].tobytes() == BYTE_ORDER_MARK else 0
    ends_with_nul = len(data) > 0 and data[-1] == 0
    text = data[start : len(data.tobytes().rstrip(b"\0")) if ends_with_nul else None]
    if (text[: 1 << 16] == 0).any():
        raise FileFormatError(f"{path}: it is not {kind}; it holds binary data")
    return text


def line_number(data: ByteArray, at: int) -> int:
    """Number, from 1, of the line that holds the byte at an offset."""
    before = data[:at]
    ends = np.count_nonzero(before == 10) or np.count_nonzero(before == 13)
    return int(ends) + 1


def decode_name(word: bytes) -> str:
    """Text of a name, UTF-8 where it is valid, else Latin-1, which any bytes are."""
    try:
        return word.decode("utf-8")
    except UnicodeDecodeError:
        return word.decode("latin-1")


def damaged(path: PathLike, error: Exception) -> FileFormatError:
    """Return the error for a file that a library cannot read, with what the library says."""
    reason = one_line(error).rstrip(".") or type(error).__name__
    return FileFormatError(
        f"{path}: it is not a {Path(path).suffix.lower()} file, or it is damaged: {reason}; "
        "export it again"
    )


def short_name(name: object) -> str:
    """Shorten a name in its middle, because parts would hold a megabyte once for each."""
    return shortened(str(name), LONGEST_NAME)


class TextLine(NamedTuple):
    """A line with something on it: its number in the file, from 1, and its words."""

    number: int
    words: list[str]


def read_lines(path: PathLike, kind: str) -> list[TextLine]:
    """Words of each line; blanks and commas separate them, `#` begins a comment, empty lines go."""
    content = text_of(path, read_array(path), kind)
    try:
        text = content.tobytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not {kind}; it is not text in UTF-8") from error
    words = (line.partition("#")[0].replace(",", " ").split() for line in text.splitlines())
    return [TextLine(number, found) for number, found in enumerate(words, start=1) if found]


def parse_row(path: PathLike, line: TextLine, n_numbers: int, what: str) -> list[float]:
    """Parse a line of `n_numbers` finite numbers; messages call the line `what`."""
    if len(line.words) != n_numbers:
        raise FileFormatError(
            f"{path}: line {line.number}: it has {counted(len(line.words), 'word')}; "
            f"{what} needs {n_numbers} numbers"
        )
    row = []
    for word in line.words:
        try:
            row.append(float(word))
        except ValueError as error:
            raise FileFormatError(
                f"{path}: line {line.number}: {quoted(word)} is not a number"
            ) from error
        if not math.isfinite(row[-1]):
            raise FileFormatError(f"{path}: line {line.number}: {quoted(word)} is not finite")
    return row


def _powers_of_five() -> npt.NDArray[np.uint64]:
    """(256, 2) uint64: high and low half of each power, its first bit shifted to bit 127."""
    halves = []
    for power in range(-128, 128):
        five = 5 ** abs(power)
        if power < 0:  # a reciprocal, rounded up
            five = (1 << (2 * five.bit_length() + 128)) // five + 1
        bits = five.bit_length()
        five = five << (128 - bits) if bits <= 128 else five >> (bits - 128)
        halves.append((five >> 64, five & (2**64 - 1)))
    return np.array(halves, dtype=np.uint64)


POWERS_OF_FIVE = _powers_of_five()


class TextNumbers(NamedTuple):
    """Numbers of a text."""

    # (n,) float64; every number, in order; may be infinite or NaN where the text says so.
    values: FloatArray
    # (m,) int64; index into `values` of the first number of each line that is not blank.
    lines: Int64Array


def parse_numbers(
    path: object, data: ByteArray, start: int = 0, stop: int | None = None, *, lead: str = ""
) -> TextNumbers:
    """Read the numbers of a text (n,) from `start` to before `stop`; ``#`` opens a comment."""
    stop = len(data) if stop is None else stop
    letter = ord(lead) if lead else 0
    tally = np.zeros(3, dtype=np.int64)
    values, lines = np.empty(0), np.empty(0, dtype=np.int64)
    hard = np.empty((0, 2), dtype=np.int64)
    fives = POWERS_OF_FIVE
    core.read_numbers(data, start, stop, letter, False, fives, values, lines, hard, tally)
    values, lines = np.empty(tally[0]), np.empty(tally[1], dtype=np.int64)
    for _ in range(2):  # again where more words are hard than there was room for
        hard = np.empty((max(int(tally[2]), 1024), 2), dtype=np.int64)
        core.read_numbers(data, start, stop, letter, True, fives, values, lines, hard, tally)
        if tally[2] <= len(hard):
            break
    for slot, at in hard[: tally[2]].tolist():
        values[slot] = read_word(path, data, at)
    return TextNumbers(values, lines)


_WORD = re.compile(rb"[^\x00-\x20\\]*")
_PLAIN = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_NOT_A_NUMBER = re.compile(rb"[-+]?(nan|ind|1\.#(ind|qnan|snan|inf|j)|inf)", re.IGNORECASE)


def read_word(path: object, data: ByteArray, at: int) -> float:
    """Read a number that the kernel could not settle; NaN for words such as those for infinity."""
    found = _WORD.match(data.data, at)
    word = found.group() if found else b""
    if _PLAIN.fullmatch(word):
        return float(word)
    if _NOT_A_NUMBER.match(word):
        return math.nan
    shown = word[:40].decode("latin-1")
    raise FileFormatError(f"{path}: line {line_number(data, at)}: {quoted(shown)} is not a number")


_BLOCK = 1 << 16  # rows formatted at once


def write_rows(file: io.BufferedWriter, row_format: str, rows: FloatArray | IntArray) -> None:
    """Write each row of a table with a format such as ``v %r %r %r``, floats in shortest form."""
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        file.write((row_format * len(block) % tuple(block.ravel().tolist())).encode("ascii"))


def write_lists(
    file: io.BufferedWriter, row_format: Callable[[int], str], sizes: Int64Array, values: IntArray
) -> None:
    """Write rows of several lengths: the format of a length takes as many rows of `values`."""
    ends = np.cumsum(sizes)
    for start in range(0, len(sizes), _BLOCK):
        block = sizes[start : start + _BLOCK].tolist()
        formats = {size: row_format(size) for size in set(block)}
        rows = values[ends[start] - block[0] : ends[start + len(block) - 1]]
        text = "".join([formats[size] for size in block])
        file.write((text % tuple(rows.ravel().tolist())).encode("ascii"))
