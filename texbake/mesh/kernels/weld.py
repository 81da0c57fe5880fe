"""Rows that are equal, bit for bit, found by hashing.

The rows are dealt into parts by the upper bits of their hash, and each part is welded by itself in
a table that fits a processor's cache. So parts can run side by side, and the result is the same for
any number of threads.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

PART_BITS = 4
_PART_SHIFT = 32 - PART_BITS


@kernel
def hash_rows_kernel(words, start, stop, hashes):  # type: ignore[no-untyped-def]
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
def weld_part_kernel(words, hashes, part, firsts):  # type: ignore[no-untyped-def]
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
