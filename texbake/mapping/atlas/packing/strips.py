"""Strips that would be thinner than a texel, such as cables: made shorter and wider.

At one texel density, the longest chart sets the scale of all charts, and where a triangle is a
thousand times as long as wide no cut makes it shorter. If strips that hold more than a hundredth of
the area would own hardly any texels, no chart becomes longer than the texture, and these strips
become as wide as texels need; so all other charts gain texels, too. Other meshes keep one density.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.packing.bitmaps import Outlines
from texbake.mesh.mesh import BoolArray, FloatArray

_STRIP = 30.0  # lengths of a strip per mean width, at least
_TOO_NARROW = 0.5  # mean width, in texels, below which a strip owns hardly any
_TEXELS = 1.5  # mean width of a strip that gets a new shape, in texels, at least
_TEXELS_A_FACE = 8.0  # area of a strip that gets a new shape, at least
_LOST = 0.01  # of the area in strips that own hardly any texels, at most
_FILL = 0.5  # share of the texture for charts and the gaps between them
_LONGEST = 0.9  # length of a chart, in sides of the texture
_HALVINGS = 60  # of the interval of a scale or length
_TINY = np.finfo(np.float64).tiny


def with_wide_strips(
    charts: Outlines, size: tuple[int, int], padding: int, n_tiles: int
) -> tuple[Outlines, BoolArray]:
    """Make strips that would own hardly any texels wider; also (C,) bool: charts it changed."""
    areas, lengths = charts.areas, np.maximum(_boxes(charts).max(axis=1), _TINY)
    widths = areas / lengths
    strips = (areas > 0.0) & (lengths > _STRIP * widths)
    unchanged, lost = np.zeros(charts.n_charts, dtype=np.bool_), _LOST * float(areas.sum())
    if areas[strips].sum() <= lost:
        return charts, unchanged
    gap, longest = 2.0 * padding + 1.0, _LONGEST * min(size)
    room = _FILL * size[0] * size[1] * n_tiles
    most_scale = math.sqrt(room / float(areas.sum()))

    def scale_of(chosen: BoolArray, room: float) -> float:
        """Texels per unit at which some charts and the gaps beside them have room."""
        length, width = lengths[chosen], widths[chosen]
        return _largest(
            lambda scale: (length * scale * (width * scale + gap)).sum() <= room, most_scale
        )

    scale = min(scale_of(~unchanged, room), longest / float(lengths.max()))
    if areas[strips & (widths * scale < _TOO_NARROW)].sum() <= lost:
        return charts, unchanged
    # Half of the room is for strips, half for the other charts, whose scale is that of all.
    scale = scale_of(~strips, room / 2.0)
    n_faces = np.bincount(charts.chart_ids[charts.faces[:, 0]], minlength=charts.n_charts)

    def sides(most: float) -> tuple[FloatArray, FloatArray]:
        """Length and mean width of each strip, in texels, if none is longer than `most`."""
        length = np.minimum(lengths[strips] * scale, most)
        wanted = np.maximum(_TEXELS, _TEXELS_A_FACE * n_faces[strips] / length)
        return length, np.maximum(widths[strips] * scale, np.minimum(wanted, length))

    def have_room(most: float) -> bool:
        length, width = sides(most)
        return float((length * (width + gap)).sum()) <= room / 2.0

    length, width = sides(_largest(have_room, longest))
    charts = charts.upright(np.where(strips, -_directions(charts), 0.0))
    boxes = np.maximum(_boxes(charts), _TINY)
    factors = longest / np.maximum(boxes * scale, longest)
    # A bent strip fills a square at most.
    most = length[:, None] / (boxes[strips] * scale)
    wider = width / (widths[strips] * scale)
    factors[strips] = np.minimum(np.stack([most[:, 0], wider], axis=1), most)
    reshaped: BoolArray = (factors != 1.0).any(axis=1)
    # Exactly along u or v, triangles thinner than a texel could lie between its centers.
    free = None if charts.aligned is None else charts.aligned & ~strips
    uvs = charts.uvs * factors[charts.chart_ids]
    return replace(charts, uvs=uvs, aligned=free), reshaped


def _boxes(charts: Outlines) -> FloatArray:
    """(C, 2) float64: sides of the bounding boxes of charts."""
    return charts.turned(np.zeros((charts.n_charts, 1))).extents[:, 0]


def _directions(charts: Outlines) -> FloatArray:
    """(C,) float64: angle in radians of the line from which the coordinates lie least far."""
    ids = charts.chart_ids
    counts = np.bincount(ids)
    x, y = (each - (np.bincount(ids, each) / counts)[ids] for each in charts.uvs.T)
    xx, xy, yy = (np.bincount(ids, product) for product in (x * x, x * y, y * y))
    return np.asarray(pm.arctan2(2.0 * xy, xx - yy) / 2.0)


def _largest(fits: Callable[[float], bool], most: float) -> float:
    """The largest number up to `most` that fits, if all smaller ones do."""
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if fits(middle) else (low, middle)
    return high
