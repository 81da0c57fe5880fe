"""Copies of triangles, which trees of boxes cannot divide: only the first of each is kept.

A ray or a point that meets one of a stack of equal triangles meets all of them, and each search
would look at each of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.weld import weld_rows

_STACK = 256  # triangles of one code, from which on copies are looked for


def without_copies(
    positions: FloatArray,
    faces: IntArray,
    ids: npt.NDArray[np.integer],
    codes: npt.NDArray[np.uint64],
) -> npt.NDArray[np.bool_]:
    """Tell which faces to keep, so that no large stack of equal ones is left.

    Parameters
    ----------
    positions : (V, 3) float64
    faces : (F, 3) int32
    ids : (n,) int
        Faces, sorted by their codes.
    codes : (n,) uint64
        Faces with the same corners, in the same order, have the same code.

    Returns
    -------
    (n,) bool
        False for a face that has the corners of one before it, if more than `_STACK` faces have
        its code.
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
    corners = positions[faces[ids[rows]]].reshape(-1, 9)
    kept[rows] = weld_rows(corners) == np.arange(len(rows))
    return kept
