"""The rows of mesh files: statements of OBJ text, and rows of a PLY element with lists in them.

OBJ text is walked once to find the lines of each kind. Then the lines of one kind are read side by
side, because each of them is now known to be the n-th of its kind.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from texbake.kernels import kernel
from texbake.mesh.kernels.decimals import decimal_kernel

# Kinds of statements, each with its own list of lines; a mark is g, o or usemtl.
V, VT, VN, F, MARK = range(5)
# Written in the place of a position index.
BAD_CORNER, OUT_OF_RANGE = -1, -2


@kernel
def lines_kernel(data, fill, nexts, offsets):  # type: ignore[no-untyped-def]
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
def words_kernel(data, starts, start, stop, values, n_words):  # type: ignore[no-untyped-def]
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
def corners_kernel(data, starts, start, stop, ends, v, vt, vn, corners):  # type: ignore[no-untyped-def]
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
                        fault = OUT_OF_RANGE
                elif part == 0 or backwards:
                    fault = BAD_CORNER
                corners[part, slot] = index if n_digits > 0 else -1
                if part < 2 and at < len(data) and data[at] == 47:  # /
                    at += 1
                    continue
                for rest in range(part + 1, 3):
                    corners[rest, slot] = -1
                break
            if at < len(data) and data[at] > 32 and data[at] != 92:
                fault = BAD_CORNER
                at = _skip_word_kernel(data, at)
            if fault < 0:
                corners[0, slot] = fault


@kernel
def walk_kernel(body, at, layout, big_endian, offsets, sizes):  # type: ignore[no-untyped-def]
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
def gather_kernel(body, offsets, lengths, units):  # type: ignore[no-untyped-def]
    """Copy the pieces of the body after each other."""
    slot = 0
    for row in range(len(offsets)):
        for unit in range(offsets[row], offsets[row] + lengths[row]):
            units[slot] = body[unit]
            slot += 1
