"""Copies of triangles, which change no result: only the first of each is searched or drawn.

A ray or a point that meets one of a stack of equal triangles meets all of them, and no tree of
boxes can divide them. A rasterizer would draw each of them over the others.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows

_STACK = 256  # triangles of one code, from which on copies are looked for
_CELLS = 2.0**40  # of the grid on which they are equal, along the longest side of the mesh


def without_copies(
    positions: FloatArray,
    faces: IntArray,
    ids: npt.NDArray[np.integer],
    codes: npt.NDArray[np.uint64],
) -> npt.NDArray[np.bool_]:
    """Tell which faces to keep, so that no large stack of equal ones is left.

    Faces whose corners are equal to about 1e-12 of the size of the mesh count as equal.

    `positions` (V, 3) float64; `faces` (F, 3) int32; `ids` (n,) int; `codes` (n,) uint64. Returns
    (n,) bool.
    """
    kept = np.ones(len(ids), dtype=np.bool_)
    if len(ids) <= _STACK:
        return kept
    # Runs of equal codes that are long enough contain a pair at this distance.
    ahead = codes[_STACK:] == codes[:-_STACK]
    if not ahead.any():
        return kept
    starts = np.flatnonzero(np.diff(codes, prepend=codes[0] ^ np.uint64(1)))
    lengths = np.diff(starts, append=len(codes))
    rows = np.flatnonzero(np.repeat(lengths > _STACK, lengths))
    low = positions.min(axis=0)
    extent = float((positions.max(axis=0) - low).max()) or 1.0
    corners = np.rint((positions[faces[ids[rows]]] - low) * (_CELLS / extent)).reshape(-1, 9)
    kept[rows] = ~later_copies(corners)
    return kept


def later_copies(rows: npt.NDArray[Any], *, n_kept: int = 1) -> npt.NDArray[np.bool_]:
    """(n,) bool: rows (n, K) that equal `n_kept` or more rows before them; one or two are kept."""
    firsts = weld_rows(rows)
    later = firsts != np.arange(len(rows))
    if n_kept == 2:
        copies = np.flatnonzero(later)
        later[copies[np.unique(firsts[copies], return_index=True)[1]]] = False
    return np.asarray(later)
