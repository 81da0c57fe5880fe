"""Streams of millions of faces, brought down in pieces that fit a processor's cache.

Kernel: `core/piecewise_simplification.c`.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import core
from texbake.mesh.decimate import VertexStream, boundary_fits, open_vertices, with_three_places
from texbake.mesh.mesh import ByteArray, Float32Array, IndexArray
from texbake.mesh.triangle_tree import morton_order
from texbake.parallel import run_bands

# Larger meshes are first reduced in pieces to this many faces, or to this multiple of the requested
# faces.
_START_FACES = 50_000
_START_TIMES = 4

_PIECE = 1 << 14  # faces that a processor's cache holds with all that belongs to them
# A collapse into a vertex looks at all of its faces in the piece, so that vertices of thousands of
# faces cost the squares of these. Where that is much, pieces are smaller, and more is done in them.
_CROWD, _MOST_LOOKS, _CROWDED_PIECE = 1 << 12, 2e8, 1 << 10
_CROWDED_START, _CROWDED_START_TIMES = 1 << 12, 1.1
_ROUND_TIMES = 8  # what a round in pieces reduces a mesh by, at most
# Each piece may go down to this share of what it would keep if all were reduced alike.
_PIECE_SHARE = 0.25
# The last collapses of a piece, around what must stay at its border, take longest. Few of them are
# used, because their errors exceed the limit of the round. So one piece in `_PIECES_PER_SAMPLE` is
# collapsed as far as possible, and the others stop at the error that would leave `_SAMPLE_SHARE` of
# the wanted faces in those. There is no such error if there are fewer than `_LEAST_PIECES`, or if
# the complete ones keep more than `_FAR_BELOW` of the wanted faces.
_PIECES_PER_SAMPLE, _LEAST_PIECES, _SAMPLE_SHARE, _FAR_BELOW = 8, 32, 0.92, 0.6
_MOST_ROUNDS = 6
_ERROR_SHIFT = 15  # bits of a float32 that two errors may differ in and count as one


def bring_down(stream: VertexStream, n_faces: int, *, threads: int | None = None) -> VertexStream:
    """Reduce a large stream until the rest is quick, leaving its boundary if that fits."""
    n_start = max(_START_FACES, _START_TIMES * n_faces)
    if _is_crowded(stream):
        n_start = max(_CROWDED_START, int(_CROWDED_START_TIMES * n_faces))
    if len(stream.faces) <= 1.25 * n_start:
        return stream
    lock_boundary = boundary_fits(stream, n_faces)
    for number in range(_MOST_ROUNDS):
        n_before = len(stream.faces)
        if n_before <= 1.25 * n_start:
            break
        n_wanted = max(n_start, n_before // _ROUND_TIMES)
        stream = reduce_pieces(
            stream, n_wanted, number=number, lock_boundary=lock_boundary, threads=threads
        )
        if len(stream.faces) > 0.9 * n_before:
            break
    return stream


def reduce_pieces(
    stream: VertexStream,
    n_wanted: int,
    *,
    number: int = 0,
    lock_boundary: bool = False,
    is_cut: bool = False,
    threads: int | None,
) -> VertexStream:
    """Reduce to about `n_wanted` faces in one round; if `is_cut`, the open edges stay."""
    faces = with_three_places(stream, stream.faces)
    # On a grid that moves from round to round.
    shift = 0.31 * number % 1.0
    order, _ = morton_order(stream.points, faces, threads, most_bits=10, shift=shift, span=2.0)
    faces = faces[order]
    vertex_of, points = stream.vertices
    n = len(faces)
    piece = _CROWDED_PIECE if _is_crowded(stream) else _PIECE
    is_shared = open_vertices(stream) if is_cut else np.zeros(len(points), dtype=bool)
    core.mark_shared_vertices(vertex_of, faces, piece, is_shared)
    gone, kept = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    errors, n_gone = np.empty(n, dtype=np.float32), np.empty(n, dtype=np.uint8)

    def collapse(pieces: IndexArray, most_error: float) -> None:
        def work(first: int, last: int) -> None:
            for start in pieces[first:last] * piece:
                stop = min(start + piece, n)
                n_least = int((stop - start) * _PIECE_SHARE * n_wanted / n)
                core.log_collapses(
                    vertex_of, points, faces, is_shared, start, stop, n_least, most_error,
                    lock_boundary, gone, kept, errors, n_gone,
                )  # fmt: skip

        run_bands(work, len(pieces), band=1, threads=threads)

    pieces = np.arange(-(-n // piece))
    is_first = pieces % _PIECES_PER_SAMPLE == _PIECES_PER_SAMPLE // 2
    collapse(pieces[is_first], math.inf)
    guess, rows = math.inf, np.repeat(is_first, piece)[:n]
    n_rows = int(np.count_nonzero(rows))
    n_least, n_aim = n_rows - int(n_gone[rows].sum(dtype=np.int64)), n_wanted * n_rows / n
    if len(pieces) >= _LEAST_PIECES and n_least < _FAR_BELOW * n_aim:
        n_first = n_rows - int(_SAMPLE_SHARE * n_aim)
        guess = _error_limit(errors[rows], n_gone[rows], n_first)
    collapse(pieces[~is_first], guess)
    limit = _error_limit(errors, n_gone, n - n_wanted)
    if limit > guess:
        collapse(pieces[~is_first], limit)  # rows were missing, so that it is at most this
        limit = _error_limit(errors, n_gone, n - n_wanted)
    n_left = core.apply_collapses(vertex_of, gone, kept, errors, limit, faces)
    return stream.restricted(faces[:n_left])


def _is_crowded(stream: VertexStream) -> bool:
    """Whether so many faces share vertices that collapsing their edges would take long."""
    vertex_of, points = stream.vertices
    return bool(core.count_looks(len(points), vertex_of, stream.faces, _CROWD) > _MOST_LOOKS)


def _error_limit(errors: Float32Array, n_gone: ByteArray, n_wanted: int) -> float:
    """Error up to which collapses take about `n_wanted` faces away, or all that are finite."""
    bins = np.zeros(1 << (32 - _ERROR_SHIFT), dtype=np.int64)  # floats from 0 sort as their bits
    n_bins = core.add_by_error(errors, n_gone, _ERROR_SHIFT, bins)
    sums = np.cumsum(bins[:n_bins])
    infinite = int(np.float32(np.inf).view(np.uint32)) >> _ERROR_SHIFT
    after = min(int(np.searchsorted(sums, n_wanted)) + 1, infinite)
    return float(np.uint32((after << _ERROR_SHIFT) - 1).view(np.float32))
