"""Rows that are equal, bit for bit, found by hashing.

Vertices that a file split at a seam have one position; corners that share position, normal and
texture coordinates share a tangent. Both are found here: exactly, with no tolerance.

The rows are dealt into parts by the upper bits of their hash, and each part is welded by itself in
a table that fits a processor's cache, so that parts can run side by side and the result is the same
for any number of threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

_PART_BITS = 4
_PART_SHIFT = 32 - _PART_BITS


def weld_rows(rows: npt.NDArray[Any], *, threads: int | None = None) -> IntArray:
    """First row that equals each row.

    Parameters
    ----------
    rows : (N, K) float64, float32 or int32
        Compared bit for bit, after -0.0 is made 0.0; so no NaN may be among them.
    threads
        None for every processor.

    Returns
    -------
    (N,) int32
        The least index of an equal row: ``rows[weld_rows(rows)] == rows``, and a row that is
        the first of its kind has its own index.

    Examples
    --------
    >>> weld_rows(np.array([[1.0, 0.0], [2.0, 0.0], [1.0, -0.0]]))
    array([0, 1, 0], dtype=int32)
    """
    values = np.array(rows, order="C")
    if values.dtype.kind == "f":
        values += values.dtype.type(0)  # -0.0 + 0.0 is 0.0
    words = values.view(np.uint32)
    hashes = np.empty(len(words), dtype=np.uint32)
    firsts = np.empty(len(words), dtype=np.int32)
    run_bands(
        lambda start, stop: _hash_rows_kernel(words, start, stop, hashes),
        len(words),
        band=1 << 18,
        threads=threads,
    )
    run_bands(
        lambda part, _: _weld_part_kernel(words, hashes, part, firsts),
        1 << _PART_BITS,
        band=1,
        threads=threads if len(words) > 1 << 14 else 1,  # below, threads cost more than they bring
    )
    return firsts


@kernel
def _hash_rows_kernel(words, start, stop, hashes):  # type: ignore[no-untyped-def]
    """Hash rows start to stop - 1 (multiply and shift, as MurmurHash2 by Austin Appleby)."""
    factor = np.uint64(0xC6A4A7935BD1E995)
    for row in range(start, stop):
        mixed = np.uint64(words.shape[1])
        for column in range(words.shape[1]):
            word = np.uint64(words[row, column]) * factor
            word ^= word >> np.uint64(47)
            mixed = (mixed ^ (word * factor)) * factor
        mixed ^= mixed >> np.uint64(47)
        mixed *= factor
        hashes[row] = np.uint32(mixed >> np.uint64(32))


@kernel
def _weld_part_kernel(words, hashes, part, firsts):  # type: ignore[no-untyped-def]
    """Weld the rows whose hash falls into one part, with open addressing and linear probing."""
    n_rows = 0
    for row in range(len(hashes)):
        if hashes[row] >> _PART_SHIFT == part:
            n_rows += 1
    size = 2
    while size < 2 * n_rows:
        size *= 2
    table = np.full(size, -1, dtype=np.int32)
    for row in range(len(hashes)):
        if hashes[row] >> _PART_SHIFT != part:
            continue
        slot = hashes[row] & (size - 1)
        while True:
            first = table[slot]
            if first < 0:
                table[slot] = row
                firsts[row] = row
                break
            if hashes[first] == hashes[row]:
                equal = True
                for column in range(words.shape[1]):
                    if words[first, column] != words[row, column]:
                        equal = False
                        break
                if equal:
                    firsts[row] = first
                    break
            slot = (slot + 1) & (size - 1)
