"""Borders between charts moved to edges of less weight.

Charts that gain or lose faces are flattened again, starting from their layouts, next to which new
faces unfold. Where a chart would stretch more, or overlap itself, its borders stay at the places
with the largest changes.

On a symmetric mesh, the borders of one half move first. Then those of the other half move close to
their mirror images, and those between the halves close to the mirror plane.

Kernel: `core/border_straightening.c`, which names the method.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.bevels import labels_of_planes
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.halves import Halves, image_costs, plane_costs
from texbake.mapping.atlas.joining.pieces import (
    ChartPiece,
    charts_of,
    connected_pieces,
    pieces_of,
    relax_piece,
    within,
)
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray
from texbake.mesh.topology import next_half_edges
from texbake.parallel import run_bands

# Rings of faces in the band about a border, for each of its edges: in the first round, and in the
# second, for borders that have not moved. No band is narrower than two rings.
BORDER_WIDTH, _NARROW = 0.1, 0.0
_WHOLE = 0.75  # share of a plane in one chart from which the rest joins it, if that chart allows it
_SAME = 1e-6  # relative difference below which areas count as equal
_ITERATIONS = 30  # of flattening
# How much the part of a chart's stretch above 1 may grow.
_ROOM, _LEAST_ROOM = 1.1, 0.006


def straighten_charts(
    surface: ChartSurface,
    charts: Charts,
    weights: FloatArray,
    *,
    halves: Halves | None = None,
    find_counterparts: Callable[[list[IntArray]], dict[int, int]] | None = None,
    n_rounds: int = 2,
) -> Charts:
    """Shorten borders, weighted by `weights` (F, 3) of edges; infinite where none may run.

    `halves`, `find_counterparts`: of a symmetric mesh, whose charts stay mirror images; `n_rounds`:
    the second is for borders that could not move in the first.
    """
    opposite = surface.opposite(charts.solid)
    pieces = pieces_of(surface, charts, opposite)
    partners = np.arange(len(pieces))
    if find_counterparts is not None:
        for one, other in find_counterparts([piece.face_ids for piece in pieces]).items():
            partners[one] = other
    for width in (BORDER_WIDTH, _NARROW)[:n_rounds] if len(pieces) > 1 else ():
        pieces = _straightened(surface, opposite, pieces, weights, width, halves, partners)
    return charts_of(pieces, charts)


def _straightened(
    surface: ChartSurface,
    opposite: IntArray,
    pieces: list[ChartPiece],
    weights: FloatArray,
    width: float,
    halves: Halves | None,
    partners: Int64Array,
) -> list[ChartPiece]:
    """Move the borders of pieces within bands about them; a piece and its partner, or neither."""
    before = np.full(len(surface.faces), -1, dtype=np.int32)
    for label, piece in enumerate(pieces):
        before[piece.face_ids] = label
    border = np.concatenate([piece.border for piece in pieces])
    slits = border[(opposite[border] >= 0) & (before[border // 3] == before[opposite[border] // 3])]
    opposite = opposite.copy()
    opposite[slits] = -1
    wanted = _moved(surface, opposite, weights, width, before, halves, partners)
    areas = _changed_areas(surface, opposite, before, wanted)
    most = np.full(len(pieces), np.inf)  # area that a chart gains or loses in one place
    current, tried = list(pieces), before
    while True:
        after = np.where(areas <= np.minimum(most[before], most[wanted]), wanted, before)
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
            current[label] = found or pieces[label]
            if found is None:
                own = np.unique(areas[moved & ((before == label) | (after == label))])
                less = own[own < (1.0 - _SAME) * own[len(own) // 2]]
                limit = less[-1] * (1.0 + _SAME) if len(less) else -1.0  # areas may be 0
                both = [label, partners[label]]
                most[both] = np.minimum(most[both], limit)
        tried = after


def _changed_areas(
    surface: ChartSurface, opposite: IntArray, before: IntArray, after: IntArray
) -> FloatArray:
    """(F,) area of the connected faces that change from the same label to the same other one."""
    pairs = (before.astype(np.int64) << 32) + after
    edges = np.flatnonzero((opposite >= 0) & (before != after)[np.arange(len(opposite)) // 3])
    edges = edges[pairs[edges // 3] == pairs[opposite[edges] // 3]]
    parts = merged_labels(len(before), edges // 3, opposite[edges] // 3)
    areas = surface_areas(surface.points[surface.faces])
    return np.where(before != after, np.bincount(parts, areas)[parts], 0.0)


def _moved(
    surface: ChartSurface,
    opposite: IntArray,
    weights: FloatArray,
    width: float,
    labels: IntArray,
    halves: Halves | None,
    partners: Int64Array,
) -> IntArray:
    """(F,) labels of faces after their borders have moved, on a symmetric mesh half by half."""
    labels = labels.copy()

    def move(where: BoolArray, weights: FloatArray) -> None:
        core.straighten_borders(
            surface.points,
            surface.corners,
            np.where(where, opposite, -1).astype(np.int32),
            weights,
            width,
            labels,
        )

    planes = surface.bevels.planes
    if halves is None:
        move(opposite >= 0, weights)
        return labels_of_planes(planes, labels, surface.polygons, least_share=_WHOLE)
    is_cut = np.repeat(halves.sides >= 0, 3)
    within = (opposite >= 0) & (is_cut == is_cut[opposite])
    move(within & is_cut, weights)
    move(within & ~is_cut, weights * image_costs(surface, halves, opposite, labels))
    pairs = np.minimum(labels, partners[labels])
    is_pair = (pairs[opposite // 3] == np.repeat(pairs, 3)) & (opposite >= 0)
    move(is_pair, weights * plane_costs(surface, halves.plane))
    return labels_of_planes(planes, labels, surface.polygons, least_share=_WHOLE)


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
                old = pieces[labels[number]]
                most = _ROOM * (old.l2 - 1.0) + _LEAST_ROOM
                if relaxed is not None and relaxed.l2 - 1.0 <= most:
                    laid[number] = None if relaxed.is_crushed([old]) else relaxed

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
