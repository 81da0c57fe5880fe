"""Rows that are equal, bit for bit: vertices at one place, corners that share all attributes.

Vertices that a file split at a seam have one position; corners that share position, normal and
texture coordinates share a tangent. Both are found here, exactly, with no tolerance. Kernel:
`core/weld.c`.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

_PART_BITS = 4
_SMALL = 1 << 14  # rows up to which parts and threads cost more than they bring


def weld_rows(rows: npt.NDArray[Any], *, threads: int | None = None) -> IntArray:
    """First row that equals each row.

    `rows` (N, K) float64, float32 or int32. Returns (N,) int32.

    Examples
    --------
    >>> weld_rows(np.array([[1.0, 0.0], [2.0, 0.0], [1.0, -0.0]]))
    array([0, 1, 0], dtype=int32)
    """
    values = np.empty(rows.shape, rows.dtype)
    words = values.view(np.uint32)
    hashes = np.empty(len(words), dtype=np.uint32)
    firsts = np.empty(len(words), dtype=np.int32)
    # A hash that is known lets a file be made whose rows all collide.
    keys = np.frombuffer(os.urandom(8 * (words.shape[1] + 1)), np.uint64)

    if len(words) <= _SMALL:
        np.add(rows, rows.dtype.type(0), out=values)
        core.hash_rows(words, keys, 0, len(words), hashes)
        core.weld_part(words, hashes, 0, 0, firsts)
        return firsts

    def work(start: int, stop: int) -> None:
        np.add(rows[start:stop], rows.dtype.type(0), out=values[start:stop])  # -0.0 + 0.0 is 0.0
        core.hash_rows(words, keys, start, stop, hashes)

    run_bands(work, len(words), band=1 << 15, threads=threads)
    run_bands(
        lambda part, _: core.weld_part(words, hashes, _PART_BITS, part, firsts),
        1 << _PART_BITS,
        band=1,
        threads=threads,
    )
    return firsts
