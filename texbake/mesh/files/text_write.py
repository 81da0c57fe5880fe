"""Rows of numbers as text, every float64 in the shortest form that reads back to the same bits."""

from __future__ import annotations

import io

from texbake.mesh.mesh import FloatArray, IntArray

_BLOCK = 1 << 16  # rows formatted at once


def write_rows(file: io.BufferedWriter, row_format: str, rows: FloatArray | IntArray) -> None:
    """Write each row of a table with a format of the % operator, such as ``v %r %r %r``.

    ``%r`` of a float is that shortest form. The format ends with a line end.
    """
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        file.write((row_format * len(block) % tuple(block.ravel().tolist())).encode("ascii"))
