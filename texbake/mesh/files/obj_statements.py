"""The statements of an OBJ file: where each kind stands, and the numbers and corners they hold.

The text is walked once to find the lines of each kind. Then the lines of one kind are read side by
side, because each of them is now known to be the n-th of its kind.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.kernels import kernel
from texbake.mesh.files.decimals import decimal_kernel, read_word
from texbake.mesh.files.source import ByteArray, line_number
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

Offsets = npt.NDArray[np.int64]
Lines = tuple[Offsets, ...]  # one list of offsets a kind

# Kinds of statements, each with its own list of lines; a mark is g, o or usemtl.
V, VT, VN, F, MARK = range(5)
_KEYWORDS = ("v", "vt", "vn", "f")
_BAND = 1 << 15  # lines
# Written in the place of a position index.
_BAD_CORNER, _OUT_OF_RANGE = -1, -2


# A word after blanks; a backslash continues a statement on the next line.
_WORD = re.compile(rb"(?:\\(?:\r\n|\r|\n)?|[\x00-\x09\x0b\x0c\x0e-\x20])*([^\x00-\x20\\]+)")


def find_lines(data: ByteArray) -> Lines:
    """Offsets of the statements of each kind: behind the keyword, at it for marks."""
    counts = np.zeros(5, dtype=np.int64)
    _lines_kernel(data, False, counts, np.empty(0, dtype=np.int64))
    ends = np.cumsum(counts)
    offsets = np.empty(ends[-1], dtype=np.int64)
    _lines_kernel(data, True, ends - counts, offsets)
    return tuple(np.split(offsets, ends[:-1]))


def read_values(
    path: PathLike, data: ByteArray, lines: Lines, kind: int, width: int
) -> tuple[FloatArray, IntArray]:
    """(n, width) numbers of the v, vt or vn lines, and (n,) how many words each line has.

    Missing numbers are 0; too few to be used are an error.
    """
    values, n_words = _walk_lines(data, lines[kind], width)
    least = 1 if kind == VT else 3
    if (n_words < least).any():
        line = line_number(data, int(lines[kind][int((n_words < least).argmax())]))
        raise FileFormatError(
            f"{path}: line {line}: too few numbers; {_KEYWORDS[kind]} needs {least}"
        )
    for row, column in np.argwhere(np.isnan(values)).tolist():
        at = int(lines[kind][row])
        for _ in range(column):
            at = _word_at(data, at)[1]
        at = _word_at(data, at)[0]
        values[row, column] = read_word(path, data, at)
        if not np.isfinite(values[row, column]):
            raise MeshError(f"{path}: line {line_number(data, at)}: a coordinate is not finite")
    return values, n_words


def _word_at(data: ByteArray, at: int) -> tuple[int, int]:
    """Where the next word of a statement begins and ends."""
    found = _WORD.match(data.data, at)
    return found.span(1) if found else (at, at)


def _walk_lines(data: ByteArray, starts: Offsets, width: int) -> tuple[FloatArray, IntArray]:
    values = np.zeros((len(starts), width))
    n_words = np.empty(len(starts), dtype=np.int32)
    run_bands(
        lambda start, stop: _words_kernel(data, starts, start, stop, values, n_words),
        len(starts),
        band=_BAND,
    )
    return values, n_words


def read_corners(path: PathLike, data: ByteArray, lines: Lines) -> tuple[IntArray, IntArray]:
    """(P,) corners of each polygon, and (3, C) their indices of v, vt and vn, -1 for none."""
    starts = lines[F]
    sizes = _walk_lines(data, starts, 0)[1]
    if (sizes < 3).any():
        line = line_number(data, int(starts[int((sizes < 3).argmax())]))
        raise FileFormatError(f"{path}: line {line}: a face needs at least three corners")
    ends = np.cumsum(sizes, dtype=np.int64)
    if max(ends[-1], *(len(lines[kind]) for kind in (V, VT, VN))) > np.iinfo(np.int32).max:
        raise FileFormatError(f"{path}: it is too large; indices must fit 32 bits")
    corners = np.empty((3, int(ends[-1])), dtype=np.int32)
    run_bands(
        lambda start, stop: _corners_kernel(
            data, starts, start, stop, ends, lines[V], lines[VT], lines[VN], corners
        ),
        len(starts),
        band=_BAND,
    )
    bad = corners[0] < 0
    if bad.any():
        slot = int(bad.argmax())
        line = line_number(data, int(starts[int(np.searchsorted(ends, slot, side="right"))]))
        what = (
            "an index is out of range; they begin at 1, or at -1 backwards"
            if corners[0, slot] == _OUT_OF_RANGE
            else "a corner is none of v, v/vt, v//vn, v/vt/vn with whole numbers"
        )
        raise FileFormatError(f"{path}: line {line}: {what}")
    return sizes, corners


@kernel
def _lines_kernel(data, fill, nexts, offsets):  # type: ignore[no-untyped-def]
    """Advance `nexts` of each statement's kind, and with `fill` put down where it stands."""
    at = 3 if len(data) > 2 and data[0] == 0xEF and data[1] == 0xBB and data[2] == 0xBF else 0
    while True:
        at = _skip_blanks_kernel(data, at)
        if at >= len(data):
            break
        first = data[at]
        second = data[at + 1] if at + 1 < len(data) else 10
        third = data[at + 2] if at + 2 < len(data) else 10
        kind, behind = -1, at
        if second <= 32:
            if first == 118:  # v
                kind, behind = V, at + 1
            elif first == 102:  # f
                kind, behind = F, at + 1
            elif first == 103 or first == 111:  # g, o
                kind = MARK
        elif first == 118 and third <= 32 and (second == 116 or second == 110):  # vt, vn
            kind, behind = VT if second == 116 else VN, at + 2
        elif first == 117 and second == 115 and third == 101:  # use: usemtl, or the rare usemap
            kind = MARK
        if kind >= 0:
            if fill:
                offsets[nexts[kind]] = behind
            nexts[kind] += 1
        at = behind
        while at < len(data) and data[at] != 10 and data[at] != 13:
            # Numbers go on behind a backslash at the end of a line; a name or a comment ends.
            if data[at] == 35:
                kind = -1
            at += 1
            if kind >= 0 and kind != MARK and data[at - 1] == 92:
                at = _skip_newline_kernel(data, at)
        at += 1


@njit(nogil=True, inline="always")
def _skip_newline_kernel(data, at):  # type: ignore[no-untyped-def]
    """Offset behind one end of line, where there is one."""
    if at < len(data) and data[at] == 13:
        at += 1
        if at >= len(data) or data[at] != 10:
            return at
    if at < len(data) and data[at] == 10:
        at += 1
    return at


@njit(nogil=True, inline="always")
def _skip_blanks_kernel(data, at):  # type: ignore[no-untyped-def]
    """Offset of the next word of a statement, or of its end; a backslash continues the line."""
    while at < len(data):
        byte = data[at]
        if byte == 92:
            at = _skip_newline_kernel(data, at + 1)
        elif byte <= 32 and byte != 10 and byte != 13:
            at += 1
        else:
            break
    return at


@njit(nogil=True, inline="always")
def _skip_word_kernel(data, at):  # type: ignore[no-untyped-def]
    """Offset behind a word."""
    while at < len(data) and data[at] > 32 and data[at] != 92:
        at += 1
    return at


@njit(nogil=True, inline="always")
def _ends_kernel(data, at):  # type: ignore[no-untyped-def]
    """Whether a statement has no more words: at the end of the line, or before a comment."""
    return at >= len(data) or data[at] == 10 or data[at] == 13 or data[at] == 35


@kernel
def _words_kernel(data, starts, start, stop, values, n_words):  # type: ignore[no-untyped-def]
    """Read the numbers of some lines; those that `values` has no column for are only counted."""
    for row in range(start, stop):
        at = starts[row]
        n = 0
        while True:
            at = _skip_blanks_kernel(data, at)
            if _ends_kernel(data, at):
                break
            if n < values.shape[1]:
                values[row, n], at = decimal_kernel(data, at, len(data))
            else:
                at = _skip_word_kernel(data, at)
            n += 1
        n_words[row] = n


@njit(nogil=True, inline="always")
def _count_before_kernel(offsets, at):  # type: ignore[no-untyped-def]
    """Number of ascending offsets below one; by bisection."""
    low, high = 0, len(offsets)
    while low < high:
        middle = (low + high) // 2
        if offsets[middle] < at:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _corners_kernel(data, starts, start, stop, ends, v, vt, vn, corners):  # type: ignore[no-untyped-def]
    """Read the corners of some f lines; v, vt, vn are the offsets of those lines."""
    for row in range(start, stop):
        at = starts[row]
        for slot in range(ends[row - 1] if row > 0 else 0, ends[row]):
            at = _skip_blanks_kernel(data, at)
            fault = 0
            for part in range(3):
                backwards = at < len(data) and data[at] == 45
                at += backwards
                index, n_digits = 0, 0
                while at < len(data) and 48 <= data[at] <= 57:
                    if index < 1 << 40:  # else it is out of range already
                        index = index * 10 + data[at] - 48
                    n_digits += 1
                    at += 1
                if n_digits > 0:
                    lines = v if part == 0 else vt if part == 1 else vn
                    index = (
                        _count_before_kernel(lines, starts[row]) - index if backwards else index - 1
                    )
                    if index < 0 or index >= len(lines):
                        fault = _OUT_OF_RANGE
                elif part == 0 or backwards:
                    fault = _BAD_CORNER
                corners[part, slot] = index if n_digits > 0 else -1
                if part < 2 and at < len(data) and data[at] == 47:  # /
                    at += 1
                    continue
                for rest in range(part + 1, 3):
                    corners[rest, slot] = -1
                break
            if at < len(data) and data[at] > 32 and data[at] != 92:
                fault = _BAD_CORNER
                at = _skip_word_kernel(data, at)
            if fault < 0:
                corners[0, slot] = fault
