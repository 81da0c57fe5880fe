"""Faces that overlap in texture space.

Pairs of faces to compare come from a tree of bounding boxes, packed over the faces in the order of
a space-filling curve. One overlap is enough to mark a face, so that a stack of thousands costs no
more than a stack of two. The number of comparisons is bounded even in the worst case, such as a
hundred thousand slivers side by side along a diagonal; faces that were not compared with all others
are reported.

Based on: Kamel, Faloutsos, "On Packing R-trees", 1993; Morton, "A computer oriented geodetic data
base", 1966 (the order). The test of two triangles is in
`core/planar_overlap.c`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

_FAN_OUT = 8  # children of a box, as in `core/planar_overlap.c`

# Overlaps up to this depth, as a share of the texture, are rounding: of float32, or of the six
# decimals of many files; ...
_DEPTH = 1e-6

# ... or up to this share of the greatest coordinate: 4 units in the last place of a float32.
_RELATIVE_DEPTH = 2.0**-22

_BAND = 4096  # faces tested by one thread at a time

# Comparisons in all, and at least for each face, before a face is left undecided. Up to 16,000
# faces that is never the case; an ordinary mesh takes about 12 comparisons per face.
_MOST_PAIRS = 1 << 28
_LEAST_PAIRS_OF_A_FACE = 512


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlaps:
    """Which faces overlap another.

    Attributes
    ----------
    overlapping : (F,) bool
    unsure : (F,) bool
        Faces without a known overlap that were compared with only some of the faces near them,
        because there are thousands of those.
    """

    overlapping: npt.NDArray[np.bool_]
    unsure: npt.NDArray[np.bool_]


def find_overlaps(corners: FloatArray, *, threads: int | None = None) -> Overlaps:
    """Find the faces that cover a part of the texture that another face covers too.

    The test compares the triangles themselves, not texels. Overlaps less deep than a millionth of
    the texture are rounding and do not count, nor do those of faces thinner than that.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Texture coordinates of the corners.
    threads
        None for every processor.
    """
    overlapping, unsure = np.zeros((2, len(corners)), dtype=np.bool_)
    farthest = float(np.abs(corners).max(initial=0.0))
    # A power of two, so that squares of any coordinate are finite and no bit is lost.
    scale = min(unit_scale(farthest), 1.0)
    depth = max(_DEPTH, _RELATIVE_DEPTH * farthest) * scale
    corners = _along_their_edges(corners * scale)
    order = _in_order(corners, np.zeros(len(corners), dtype=np.int32), depth)
    boxes, children = _packed_boxes(corners, order, None)
    lines, places = _inward_lines(corners), np.arange(len(order))
    most = max(_LEAST_PAIRS_OF_A_FACE, _MOST_PAIRS // max(len(order), 1))

    def look(start: int, stop: int) -> None:
        core.find_planar_overlaps(
            corners, lines, order, boxes, children, depth, most, places[start:stop],
            overlapping, unsure, None,
        )  # fmt: skip

    run_bands(look, len(order), band=_BAND, threads=threads)
    return Overlaps(overlapping=overlapping, unsure=unsure)


def overlapping_faces(corners: FloatArray, *, threads: int | None = None) -> npt.NDArray[np.bool_]:
    """Find the faces that cover a part of the texture that another face covers too.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Texture coordinates of the corners.
    threads
        None for every processor.

    Returns
    -------
    (F,) bool
        False for faces that share only an edge or a corner, and for faces without area. See
        `find_overlaps` for faces that could not be compared with all others.

    Examples
    --------
    >>> square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    >>> overlapping_faces(square)
    array([False, False])
    >>> overlapping_faces(square - [[[0, 0]], [[0, 0.1]]])
    array([ True,  True])
    """
    return find_overlaps(corners, threads=threads).overlapping


def overlap_layers(corners: FloatArray, charts: IntArray, *, depth: float) -> IntArray:
    """Spread the faces of each chart over layers, so that no two faces of one layer overlap.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Coordinates of the corners.
    charts : (F,) int32
        Chart of each face; faces of different charts are not compared.
    depth : float
        Overlaps up to this depth, in the unit of `corners`, do not count.

    Returns
    -------
    (F,) int32
        Layer of each face: the lowest that earlier faces leave free, so 0 throughout a chart
        without overlaps. The time grows with the number of overlaps.
    """
    corners = _along_their_edges(corners)
    charts = np.ascontiguousarray(charts, dtype=np.int32)
    layers = np.zeros(len(corners), dtype=np.int32)
    order = _in_order(corners, charts, depth)
    boxes, children = _packed_boxes(corners, order, charts)
    lines, places = _inward_lines(corners), np.argsort(order, kind="stable")
    found, unsure = np.zeros((2, len(corners)), dtype=np.bool_)
    core.find_planar_overlaps(
        corners, lines, order, boxes, children, depth, len(corners), places,
        found, unsure, layers,
    )  # fmt: skip
    return layers


def _along_their_edges(corners: FloatArray) -> FloatArray:
    """Corners rotated so that long edges lie along an axis, as far as one rotation can do that.

    Bounding boxes of long triangles are then tight.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = (edges**2).sum(axis=2)
    # Squared as complex numbers, edges of opposite directions are equal.
    squared = (edges[..., 0] + 1j * edges[..., 1]) ** 2
    longest = np.take_along_axis(squared, lengths.argmax(axis=1)[:, None], axis=1)
    angle = -np.angle(longest.sum()) / 2.0
    cos, sin = math.cos(angle), math.sin(angle)
    s, t = corners[..., 0], corners[..., 1]
    return np.ascontiguousarray(np.stack([cos * s - sin * t, sin * s + cos * t], axis=2))


def _inward_lines(corners: FloatArray) -> FloatArray:
    """(F, 3, 3) float64: (a, b, c) of each edge, so that a s + b t + c is the distance inwards."""
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.hypot(edges[..., 0], edges[..., 1])
    doubles = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    lengths = np.maximum(lengths, np.finfo(np.float64).tiny) * np.where(doubles < 0, -1, 1)[:, None]
    a, b = -edges[..., 1] / lengths, edges[..., 0] / lengths
    return np.stack([a, b, -(a * corners[..., 0] + b * corners[..., 1])], axis=2)


def _in_order(corners: FloatArray, charts: IntArray, depth: float) -> npt.NDArray[np.int64]:
    """Faces at least `depth` thick, in the order of charts and then of a space-filling curve."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubles = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    longest = np.maximum((first**2).sum(axis=1), (second**2).sum(axis=1))
    longest = np.maximum(longest, ((second - first) ** 2).sum(axis=1))
    kept = np.flatnonzero(doubles > depth * np.sqrt(longest))
    if len(kept) == 0:
        return kept
    middles = corners[kept].mean(axis=1)
    low = middles.min(axis=0)
    extent = max(float((middles.max(axis=0) - low).max()), np.finfo(np.float64).tiny)
    cells = ((middles - low) / extent * 65535.0).astype(np.uint64)
    codes = _spread_bits(cells[:, 0]) | _spread_bits(cells[:, 1]) << np.uint64(1)
    codes |= charts[kept].astype(np.uint64) << np.uint64(32)
    return kept[np.argsort(codes, kind="stable")]


def _spread_bits(values: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """16 bits, each moved to twice its position."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        values = (values | values << np.uint64(shift)) & np.uint64(mask)
    return values


def _packed_boxes(
    corners: FloatArray, order: npt.NDArray[np.int64], charts: IntArray | None
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Boxes around the faces in order, then around each `_FAN_OUT` of those, up to a single one.

    Returns
    -------
    boxes : (B, 6) float64
        Least s, t and chart, then the greatest. Row i is the box of the i-th face in order; the
        last row is the box of everything.
    children : (B, 2) int64
        First row inside each box, and the one after the last; equal for the boxes of faces.
    """
    faces = corners[order]
    ids = np.zeros(len(order)) if charts is None else charts[order].astype(np.float64)
    level = np.column_stack([faces.min(axis=1), ids, faces.max(axis=1), ids])
    levels = [level]
    children = [np.zeros((len(level), 2), dtype=np.int64)]
    start = 0
    while len(level) > 1:
        firsts = np.arange(0, len(level), _FAN_OUT)
        stops = np.minimum(firsts + _FAN_OUT, len(level))
        children.append(start + np.column_stack([firsts, stops]))
        start += len(level)
        level = np.column_stack(
            [
                np.minimum.reduceat(level[:, :3], firsts, axis=0),
                np.maximum.reduceat(level[:, 3:], firsts, axis=0),
            ]
        )
        levels.append(level)
    return np.concatenate(levels), np.concatenate(children)
