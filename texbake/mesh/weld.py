"""Rows that are equal, bit for bit: vertices at one place, corners that share all attributes.

Vertices that a file split at a seam have one position; corners that share position, normal and
texture coordinates share a tangent. Both are found here, exactly, with no tolerance.

Of triangles that are copies, only the first is searched or drawn: a ray or a point that meets one
of a stack of equal triangles meets all of them, and no tree of boxes can divide them. Kernel:
`core/weld.c`.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.parallel import run_bands

_PART_BITS = 4
_SMALL = 1 << 14  # rows up to which parts and threads cost more than they bring


def weld_rows(rows: AnyArray, *, threads: int | None = None) -> IntArray:
    """(N,) int32: first row that equals each row of (N, K) float64, float32 or int32."""
    rows = np.ascontiguousarray(rows)
    negative_zero = rows.view(f"u{rows.itemsize}") == 1 << (8 * rows.itemsize - 1)
    if negative_zero.any():
        rows = rows + rows.dtype.type(0)  # -0.0 + 0.0 is 0.0
    words = rows.view(np.uint32)
    hashes = np.empty(len(words), dtype=np.uint32)
    firsts = np.empty(len(words), dtype=np.int32)
    # A hash that is known lets a file be made whose rows all collide.
    keys = np.frombuffer(os.urandom(8 * (words.shape[1] + 1)), np.uint64)

    if len(words) <= _SMALL:
        core.hash_rows(words, keys, 0, len(words), hashes)
        core.weld_part(words, hashes, 0, 0, firsts)
        return firsts

    run_bands(
        lambda start, stop: core.hash_rows(words, keys, start, stop, hashes),
        len(words),
        band=1 << 15,
        threads=threads,
    )
    run_bands(
        lambda part, _: core.weld_part(words, hashes, _PART_BITS, part, firsts),
        1 << _PART_BITS,
        band=1,
        threads=threads,
    )
    return firsts


def unique_rows(rows: AnyArray) -> tuple[IndexArray, IntArray]:
    """Places of the first of equal rows, in order, and the number of each row among them.

    >>> unique_rows(np.array([[1.0], [2.0], [1.0]]))
    (array([0, 1]), array([0, 1, 0], dtype=int32))
    """
    firsts = weld_rows(rows)
    is_first = firsts == np.arange(len(firsts), dtype=np.int32)
    numbers = np.cumsum(is_first, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(is_first), numbers[firsts]


def unique_corners(
    vertices: npt.NDArray[np.integer], values: AnyArray
) -> tuple[FloatArray, IntArray]:
    """Distinct values of each vertex (n, K), and the number of each corner's, as `vertices`."""
    rows = np.concatenate([vertices.reshape(-1, 1), values], axis=1, dtype=np.float64)
    kept, numbers = unique_rows(rows)
    return values[kept].astype(np.float64), numbers.reshape(vertices.shape)


def split_vertices(mesh: Mesh) -> tuple[Int64Array, Int64Array, IntArray]:
    """New vertices with one uv and normal each: vertex, corner (-1: unused), (n,); and faces."""
    used = np.full(mesh.n_vertices, -1)
    keys = [mesh.faces.ravel()]
    for values, ids in ((mesh.uvs, mesh.uv_faces), (mesh.normals, mesh.normal_faces)):
        if values is None or ids is None:
            continue
        used[keys[0]] = np.arange(mesh.faces.size)
        if not np.array_equal(ids.ravel()[used[mesh.faces]], ids):
            keys.append(weld_rows(values)[ids.ravel()])
    if len(keys) == 1:  # each vertex has the values of the last corner that uses it
        return np.arange(mesh.n_vertices), used, mesh.faces
    firsts = weld_rows(np.stack(keys, axis=1))
    places = np.flatnonzero(firsts == np.arange(len(firsts)))  # a corner of each new vertex
    vertices, of_vertex = np.unique(mesh.faces.ravel()[places], return_index=True)
    is_copy = np.ones(len(places), np.bool_)
    is_copy[of_vertex] = False
    copies = places[is_copy]
    corners: Int64Array = np.append(np.full(mesh.n_vertices, -1), copies)
    corners[vertices] = places[of_vertex]
    numbers = np.empty(len(firsts), np.int32)  # of the new vertex at its first corner
    numbers[corners[corners >= 0]] = np.flatnonzero(corners >= 0)
    rows: Int64Array = np.append(np.arange(mesh.n_vertices), mesh.faces.ravel()[copies]).astype(
        np.int64
    )
    faces: IntArray = numbers[firsts].reshape(-1, 3)
    return rows, corners, faces


def values_of_vertices(values: AnyArray, ids: IntArray, corners: Int64Array) -> AnyArray:
    """(n, K) values of the `corners` that `split_vertices` returns; 0 where no face is."""
    by_vertex = values[ids.ravel()[corners]]
    by_vertex[corners < 0] = 0.0
    return by_vertex


_STACK = 256  # triangles of one code, from which on copies are looked for
_CELLS = 2.0**40  # of the grid on which they are equal, along the longest side of the mesh


def without_copies(
    positions: FloatArray,
    faces: IntArray,
    ids: npt.NDArray[np.integer],
    codes: npt.NDArray[np.unsignedinteger],
) -> BoolArray:
    """(n,) bool: which of `ids`, sorted by `codes`, stay: no large stack of copies is left."""
    kept = np.ones(len(ids), dtype=np.bool_)
    if len(ids) <= _STACK:
        return kept
    # Runs of equal codes that are long enough contain a pair at this distance.
    ahead = codes[_STACK:] == codes[:-_STACK]
    if not ahead.any():
        return kept
    starts = np.flatnonzero(np.diff(codes, prepend=codes[:1] ^ codes.dtype.type(1)))
    lengths = np.diff(starts, append=len(codes))
    rows = np.flatnonzero(np.repeat(lengths > _STACK, lengths))
    low = positions.min(axis=0)
    extent = float((positions.max(axis=0) - low).max()) or 1.0
    corners = np.rint((positions[faces[ids[rows]]] - low) * (_CELLS / extent)).reshape(-1, 9)
    kept[rows] = ~later_copies(corners)
    return kept


def later_copies(rows: AnyArray, *, n_kept: int = 1) -> BoolArray:
    """(n,) bool: rows (n, K) that equal `n_kept` or more rows before them; one or two are kept."""
    firsts = weld_rows(rows)
    later = firsts != np.arange(len(rows))
    if n_kept == 2:
        copies = np.flatnonzero(later)
        later[copies[np.unique(firsts[copies], return_index=True)[1]]] = False
    return np.asarray(later)


def row_sums(numbers: AnyArray, rows: FloatArray, n: int) -> FloatArray:
    """(n, K) sums of the rows of each number."""
    return np.stack([np.bincount(numbers, column, n) for column in rows.T], axis=1)
