"""Decimal numbers in text, read and written so that every float64 keeps its bits.

Kernel: `core/decimals.c`.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import FileFormatError, quoted
from texbake.mesh.files.source import ByteArray, line_number
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray


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
