"""Borders between charts moved to edges of less weight.

Charts that gain or lose faces are flattened again, starting from their layouts, next to which new
faces unfold. A chart that would stretch more, or overlap itself, keeps its borders.

Kernel: `core/border_straightening.c`, which names the method.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.joining.pieces import (
    ChartPiece,
    charts_of,
    connected_pieces,
    pieces_of,
    relax_piece,
    within,
)
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.mesh.topology import next_half_edges
from texbake.parallel import run_bands

_WIDTH = 0.1  # rings of faces in the band about a border, for each of its edges
_ITERATIONS = 30  # of flattening
# How much the part of a chart's stretch above 1 may grow.
_ROOM, _LEAST_ROOM = 1.1, 0.002


def straighten_charts(surface: ChartSurface, charts: Charts, weights: FloatArray) -> Charts:
    """Shorten borders, weighted by `weights` (F, 3) of edges; infinite where none may run."""
    opposite = surface.opposite(charts.solid)
    pieces = pieces_of(surface, charts, opposite)
    if len(pieces) > 1:
        pieces = _straightened(surface, opposite.copy(), pieces, weights)
    return charts_of(pieces, charts)


def _straightened(
    surface: ChartSurface,
    opposite: IntArray,
    pieces: list[ChartPiece],
    weights: FloatArray,
) -> list[ChartPiece]:
    """Move the borders of pieces within bands about them."""
    before = np.full(len(surface.faces), -1, dtype=np.int32)
    for label, piece in enumerate(pieces):
        before[piece.face_ids] = label
    border = np.concatenate([piece.border for piece in pieces])
    slits = border[(opposite[border] >= 0) & (before[border // 3] == before[opposite[border] // 3])]
    opposite[slits] = -1
    after = before.copy()
    core.straighten_borders(surface.points, surface.corners, opposite, weights, _WIDTH, after)
    current = list(pieces)
    tried, refused = before, np.zeros(len(pieces), dtype=bool)
    while True:
        kept = (after != before) & (refused[before] | refused[after])
        after = np.where(kept, before, after)
        faces = after != tried
        if not faces.any():
            return current
        is_changed, is_moved = np.zeros((2, len(pieces)), dtype=bool)
        moved = after != before
        is_changed[tried[faces]] = is_changed[after[faces]] = True
        is_moved[before[moved]] = is_moved[after[moved]] = True
        for label in np.flatnonzero(is_changed).tolist():
            current[label] = pieces[label]
        labels = np.flatnonzero(is_changed & is_moved).astype(np.int32)
        laid = _laid(surface, opposite, before, after, labels, pieces)
        for label, found in zip(labels.tolist(), laid, strict=True):
            refused[label] |= found is None
            current[label] = found or pieces[label]
        tried = after


def _laid(
    surface: ChartSurface,
    opposite: IntArray,
    before: IntArray,
    after: IntArray,
    labels: IntArray,
    pieces: list[ChartPiece],
) -> list[ChartPiece | None]:
    """Flatten charts, by labels, whose faces have changed; None for a chart that gets worse."""
    face_ids = np.flatnonzero(np.isin(after, labels)).astype(np.int32)
    if not len(face_ids):
        return [None] * len(labels)
    corners = surface.points[surface.faces[face_ids]]
    half_edges = (3 * face_ids[:, None] + np.arange(3, dtype=np.int32)).ravel()
    across = opposite[half_edges]
    glued = (across >= 0) & (after[across // 3] == after[half_edges // 3])
    one, other = within(face_ids, half_edges[glued]), within(face_ids, across[glued])
    corner_uvs = _unfolded(before, after, face_ids, corners, one, other, pieces)
    found = connected_pieces(face_ids, corners, corner_uvs, one, other)
    laid: list[ChartPiece | None] = [None] * len(labels)  # also of a chart that vanishes
    numbers = np.searchsorted(labels, [after[piece.face_ids[0]] for piece in found])
    is_single = np.bincount(numbers, minlength=len(labels)) == 1

    def relax(first: int, last: int) -> None:
        for number, piece in zip(numbers[first:last], found[first:last], strict=True):
            if is_single[number]:
                relaxed = relax_piece(piece, n_iterations=_ITERATIONS)
                most = _ROOM * (pieces[labels[number]].l2 - 1.0) + _LEAST_ROOM
                if relaxed is not None and relaxed.l2 - 1.0 <= most:
                    laid[number] = relaxed

    run_bands(relax, len(found), band=1, threads=surface.threads)
    return laid


def _unfolded(
    before: IntArray,
    after: IntArray,
    face_ids: IntArray,
    corners: FloatArray,
    one: IntArray,
    other: IntArray,
    pieces: list[ChartPiece],
) -> FloatArray:
    """(m, 3, 2) layout of faces: that of their chart, with new faces unfolded next to it."""
    vertices = merged_labels(
        3 * len(face_ids),
        np.concatenate([one, next_half_edges(one)]),
        np.concatenate([next_half_edges(other), other]),
    ).reshape(-1, 3)
    n = int(vertices.max()) + 1
    uvs, points = np.zeros((n, 2)), np.zeros((n, 3))
    points[vertices] = corners
    is_placed: BoolArray = np.zeros(n, dtype=bool)
    rows = np.flatnonzero(before[face_ids] == after[face_ids])
    is_placed[vertices[rows]] = True
    for label in np.unique(after[face_ids[rows]]):
        piece, own = pieces[label], rows[after[face_ids[rows]] == label]
        at = np.searchsorted(piece.face_ids, face_ids[own])
        uvs[vertices[own]] = piece.uvs[piece.faces[at]]
    core.unfold_triangles(points, vertices.astype(np.int32), is_placed, uvs)
    return uvs[vertices]
