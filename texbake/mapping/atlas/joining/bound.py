"""Charts cut in two until none is stretched beyond a bound.

A chart is first flattened again, which may be enough. If not, it is cut along a straight line
through its layout: across or along it, through the middle of its area or of its stretch, whichever
leaves the least stretch. Parts that were cut off needlessly are joined again where the bound allows
it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.pieces import (
    ChartPiece,
    charts_of,
    parts_of,
    pieces_of,
    relax_piece,
    whole_polygons,
)
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

_ROUGH_ITERATIONS = 6  # to choose a line by
_FULL_ITERATIONS = 40

# Charts of one face that a report lists; the rest are only counted.
_MOST_NAMED = 4


def bound_charts(surface: ChartSurface, charts: Charts, *, max_stretch: float) -> Charts:
    """Cut charts in two until none has an L2 stretch above `max_stretch` at its own area."""
    solid = charts.solid
    if not solid.any():
        return charts
    opposite, polygons = replace(surface, regions=None).opposite(solid), surface.polygons
    pieces = pieces_of(surface, charts, opposite)
    if all(piece.l2 <= max_stretch for piece in pieces):
        return charts
    held: list[list[ChartPiece]] = [[] for _ in pieces]

    def hold(start: int, stop: int) -> None:
        for index in range(start, stop):
            held[index] = _held(pieces[index], opposite, polygons, max_stretch)

    run_bands(hold, len(pieces), band=1, threads=surface.threads)
    cut = charts_of([part for parts in held for part in parts], charts)
    origins = np.zeros(len(surface.faces), dtype=np.int32)
    for index, piece in enumerate(pieces):
        origins[piece.face_ids] = index
    bounded = join_charts(
        replace(surface, regions=origins),
        cut,
        most_l2=max_stretch,
        most_chart_l2=max_stretch,
        most_share=1.0,
        most_waste=math.inf,
    )
    missed = [part for parts in held for part in parts if part.l2 > max_stretch]
    return replace(bounded, notes=(*bounded.notes, *_notes(missed, bounded, max_stretch)))


def _held(
    piece: ChartPiece, opposite: IntArray, polygons: IntArray | None, max_stretch: float
) -> list[ChartPiece]:
    """Parts of a piece that meet the bound or are single faces."""
    parts: list[ChartPiece] = []
    left = [piece]
    while left:
        piece = left.pop()
        if piece.l2 > max_stretch:
            piece = _relaxed(piece, _FULL_ITERATIONS)
        if piece.l2 <= max_stretch or len(piece.faces) == 1:
            parts.append(piece)
        else:
            left += _halves(piece, opposite, polygons)
    return parts


def _relaxed(piece: ChartPiece, n_iterations: int) -> ChartPiece:
    """Return a piece with a better layout, or unchanged."""
    relaxed = relax_piece(piece, n_iterations=n_iterations)
    return relaxed if relaxed is not None and relaxed.l2 < piece.l2 else piece


def _halves(piece: ChartPiece, opposite: IntArray, polygons: IntArray | None) -> list[ChartPiece]:
    """Cut a piece of two faces or more along the line that leaves the least stretch."""
    best: list[ChartPiece] = []
    least = np.inf
    for sides in _lines(piece):
        whole = whole_polygons(piece, sides, polygons)
        parts = parts_of(piece, sides if whole.all() or not whole.any() else whole, opposite)
        relaxed = [_relaxed(part, _ROUGH_ITERATIONS) for part in parts]
        excess = sum(part.excess for part in relaxed)
        if excess < least or not best:
            best, least = relaxed, excess
    return best


def _lines(piece: ChartPiece) -> list[npt.NDArray[np.bool_]]:
    """Four ways to divide the faces of a piece by a line, as (m,) sides; no side is empty."""
    corners, uvs = piece.points[piece.faces], piece.uvs[piece.faces]
    areas, centers = surface_areas(corners), uvs.mean(axis=1)
    grown = np.abs(signed_areas(uvs) / np.maximum(areas, np.finfo(float).tiny))
    weights = np.maximum(areas, np.finfo(float).tiny)
    about = centers - np.average(centers, axis=0, weights=weights)
    _, axes = pm.eigh((weights[:, None, None] * about[:, :, None] * about[:, None]).sum(0))
    # Areas that have changed much show curvature, which a cut through it removes.
    stretched = weights * np.abs(pm.log(np.clip(grown, 1e-6, 1e6)))
    lines = []
    for axis in (axes[:, 1], axes[:, 0]):
        order = np.argsort(pm.matmul(about, axis), kind="stable")
        for measure in (weights, stretched):
            sums = np.cumsum(measure[order])
            middle = int(np.searchsorted(sums, 0.5 * sums[-1]))
            sides = np.zeros(len(order), dtype=bool)
            sides[order[: min(max(middle, 1), len(order) - 1)]] = True
            lines.append(sides)
    return lines


def _notes(missed: list[ChartPiece], charts: Charts, max_stretch: float) -> tuple[str, ...]:
    """Notes on the charts that miss the bound, and why."""
    notes = [
        f"chart {charts.chart_ids[charts.faces[piece.face_ids[0], 0]]} (face {piece.face_ids[0]}) "
        f"has stretch {piece.l2:.3g}, above {max_stretch:g}: the face is too thin to be flattened"
        for piece in missed[:_MOST_NAMED]
    ]
    if len(missed) > _MOST_NAMED:
        notes.append(f"so do {len(missed) - _MOST_NAMED} other charts of one face each")
    return tuple(notes)
