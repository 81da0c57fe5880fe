"""Sprawling charts divided at their necks: where a short cut separates a limb from the rest.

A chart with limbs leaves much of its convex hull empty, and its limbs may overlap. Of the chords
between two places on the outline, texbake cuts along the one that saves most empty area for its
length, or that separates most overlapping faces.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.cutting.path_mirror import PathMirror
from texbake.mapping.atlas.cutting.repair import OVERLAP_DEPTH
from texbake.mapping.atlas.joining.pieces import ChartPiece, LongArray, hull_area, parts_of
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.mesh.symmetry import MirrorPlane
from texbake.mesh.topology import EdgeGraph, edge_keys, opposite_half_edges, path_back
from texbake.records import dataclass

_PLACES = 64  # on an outline, where chords end
_INNER = (0.2, 0.5, 0.8)  # points of a chord that must lie in the chart
_LEAST_SHARE = 0.03  # least area of a limb, as a share of the body
# Most chords that are tried for a division, and most faces of the pieces cut in all these trials.
_MOST_TRIED, _MOST_FACES = 8, 100_000
_MOST_PARTS = 32
# Distances in steps of a cut: of its mirror image, below which they are one cut; and of the image's
# ends from the border of a piece that it cuts, which may also be a share of the length of the cut.
_SAME_PATH, _NEAR_IMAGE, _NEAR_SHARE = 2.0, 2.0, 0.05
_LEAST_OVERLAP = 1e-3  # of the area of the body; smaller overlaps are repaired later


def divide_at_necks(
    pieces: list[ChartPiece],
    opposite: IntArray,
    weights: FloatArray,
    *,
    least_gain: float,
    side: float,
    plane: MirrorPlane | None = None,
) -> list[ChartPiece]:
    """Divide pieces until none overlaps itself and no neck gains enough.

    `weights` (F, 3): cost of a seam for each unit of length; `least_gain`: empty area saved, in
    units of `side` times the length of the cut, or its cost if that is more; `plane`: cuts are
    followed by their mirror images.
    """
    most = len(pieces) + _MOST_PARTS
    left, done = list(pieces), list[ChartPiece]()
    while left:
        piece = left.pop()
        parts: list[ChartPiece] = []
        if len(done) + len(left) < most:
            parts, path = _divided(piece, opposite, weights, least_gain, side)
        if not parts:
            done.append(piece)
            continue
        left += parts
        if plane is not None:
            _cut_image(left, done, opposite, weights, plane, path)
    return done


def _divided(
    piece: ChartPiece, opposite: IntArray, weights: FloatArray, least_gain: float, side: float
) -> tuple[list[ChartPiece], FloatArray]:
    """Two or more parts of a piece, and points of the cut; none if no cut is worth its length."""
    loop, none = _outline(piece), np.empty((0, 3))
    if loop is None:
        return [], none
    chords = _chords(piece, loop, _LEAST_SHARE * side**2)
    graph = _PieceGraph(piece, weights)
    n_tried = min(max(_MOST_FACES // len(piece.faces), 1), _MOST_TRIED)
    overlap = _overlap(piece)
    if overlap > _LEAST_OVERLAP * side**2:
        order = np.argsort(chords.lengths / np.sqrt(chords.areas), kind="stable")[:n_tried]
        tried = [
            (sum(_overlap(part) for part in parts), length, (parts, path))
            for parts, length, path in _cuts(piece, opposite, graph, chords, order)
        ]
        gain, number = max(
            (((overlap - left) / length, -i) for i, (left, length, _) in enumerate(tried)),
            default=(0.0, 0),
        )
        if gain > 0.0:
            return tried[-number][2]
    gains = chords.saved / (chords.lengths * side)
    order = np.argsort(-gains, kind="stable")
    order = order[gains[order] >= least_gain][:n_tried]
    for parts, length, path in _cuts(piece, opposite, graph, chords, order):
        if piece.waste - sum(part.waste for part in parts) >= least_gain * length * side:
            return parts, path
    return [], none


def _cut_image(
    left: list[ChartPiece],
    done: list[ChartPiece],
    opposite: IntArray,
    weights: FloatArray,
    plane: MirrorPlane,
    path: FloatArray,
) -> None:
    """Cut the piece that contains the mirror image of a path (k, 3), if one does, in place."""
    images = plane.mirrored(path)
    steps = pm.norm(path[1:] - path[:-1], axis=1)
    step = float(steps.mean())
    apart = np.abs(images[:, None] - path).max(axis=2).min(axis=1)
    if apart.max() <= _SAME_PATH * step:
        return
    most = max(_NEAR_IMAGE * step, _NEAR_SHARE * float(steps.sum()))
    for pieces in (left, done):
        for number, piece in enumerate(pieces):
            rim = np.unique(piece.border_ends)
            gaps = [pm.norm(piece.points[rim] - end, axis=1) for end in (images[0], images[-1])]
            if max(float(gap.min()) for gap in gaps) > most:
                continue
            starts, ends = (rim[gap <= gap.min() + 1e-9 * step] for gap in gaps)
            sides = _PieceGraph(piece, weights).sides_near(starts, ends, path, plane)
            if sides is not None:
                del pieces[number]
                left += parts_of(piece, sides, opposite)
                return


def _cuts(
    piece: ChartPiece, opposite: IntArray, graph: _PieceGraph, chords: _Chords, order: LongArray
) -> Iterator[tuple[list[ChartPiece], float, FloatArray]]:
    """Parts on both sides of cuts near chords, the lengths of the cuts, and their points."""
    for number in order.tolist():
        found = graph.sides(int(chords.starts[number]), int(chords.ends[number]))
        if found is not None:
            yield parts_of(piece, found[0], opposite), *found[1:]


def _overlap(piece: ChartPiece) -> float:
    """Area of the faces that lie on others."""
    uvs = piece.uvs[piece.faces]
    layers = overlap_layers(uvs, np.zeros(len(uvs), dtype=np.int32), depth=OVERLAP_DEPTH)
    return float(surface_areas(piece.points[piece.faces])[layers > 0].sum())


def _outline(piece: ChartPiece) -> IntArray | None:
    """Vertices of the longest loop of the border, in its direction; None if loops touch."""
    tails, heads = piece.border_ends.T
    after = np.full(len(piece.points), -1, dtype=np.int64)
    after[tails] = heads
    if len(np.unique(tails)) < len(tails):
        return None
    labels = merged_labels(len(piece.points), tails.astype(np.int32), heads.astype(np.int32))
    lengths = pm.norm(piece.uvs[heads] - piece.uvs[tails], axis=1)
    longest = int(np.bincount(labels[tails], lengths).argmax())
    start = int(tails[labels[tails] == longest].min())
    return np.fromiter(_followed(after.tolist(), start), dtype=np.int32)


def _followed(after: list[int], start: int) -> Iterator[int]:
    yield start
    at = after[start]
    while at != start:
        yield at
        at = after[at]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Chords:
    """Straight cuts through a chart between two vertices of its outline."""

    starts: IntArray
    ends: IntArray
    lengths: FloatArray
    areas: FloatArray  # of the smaller side
    saved: FloatArray  # area of convex hulls that a cut saves


def _chords(piece: ChartPiece, loop: IntArray, least_area: float) -> _Chords:
    """Chords between places of the outline that stay in the chart, and what they separate."""
    outline = piece.uvs[loop]
    steps = pm.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    along = np.cumsum(steps) - steps
    wanted = np.arange(_PLACES) * (float(steps.sum()) / _PLACES)
    at = np.unique(np.searchsorted(along, wanted))
    at = at[at < len(loop)]
    one, other = np.triu_indices(len(at), 2)
    a, b = outline[at[one]], outline[at[other]]
    crosses = outline[:, 0] * np.roll(outline[:, 1], -1) - outline[:, 1] * np.roll(
        outline[:, 0], -1
    )
    sums = np.concatenate([[0.0], np.cumsum(crosses)])
    areas = sums[at[other]] - sums[at[one]] + b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]
    areas = np.minimum(areas / 2.0, piece.area - areas / 2.0)
    lengths = pm.norm(b - a, axis=1)
    kept = np.flatnonzero((areas >= least_area) & (lengths > 0.0) & (lengths**2 < 4.0 * areas))
    kept = kept[_inside(outline, a[kept], b[kept])]
    one, other = one[kept], other[kept]
    whole = piece.hull_area
    saved = [
        whole
        - hull_area(outline[at[i] : at[j] + 1])
        - hull_area(np.concatenate([outline[at[j] :], outline[: at[i] + 1]]))
        for i, j in zip(one.tolist(), other.tolist(), strict=True)
    ]
    return _Chords(
        starts=loop[at[one]],
        ends=loop[at[other]],
        lengths=lengths[kept],
        areas=areas[kept],
        saved=np.array(saved, dtype=np.float64),
    )


def _inside(outline: FloatArray, starts: FloatArray, ends: FloatArray) -> BoolArray:
    """Whether points between starts and ends (n, 2) lie within an outline (k, 2)."""
    tails, heads = outline, np.roll(outline, -1, axis=0)
    inside = np.ones(len(starts), dtype=bool)
    for share in _INNER:
        points = starts + share * (ends - starts)
        x, y = points[:, :1], points[:, 1:]
        rises = (tails[:, 1] <= y) & (heads[:, 1] > y)
        falls = (tails[:, 1] > y) & (heads[:, 1] <= y)
        left = (heads[:, 0] - tails[:, 0]) * (y - tails[:, 1]) - (x - tails[:, 0]) * (
            heads[:, 1] - tails[:, 1]
        )
        inside &= (rises & (left > 0.0)).sum(axis=1) > (falls & (left < 0.0)).sum(axis=1)
    return inside


class _PieceGraph:
    """The edges of a piece, to cut it along shortest paths."""

    def __init__(self, piece: ChartPiece, weights: FloatArray) -> None:
        self._piece = piece
        tails, heads = piece.faces.ravel(), np.roll(piece.faces, -1, axis=1).ravel()
        lengths = pm.norm(piece.points[heads] - piece.points[tails], axis=1)
        costs = lengths * weights[piece.face_ids].ravel()
        self._graph = EdgeGraph.build(
            len(piece.points),
            np.concatenate([tails, heads]),
            np.concatenate([heads, tails]),
            np.concatenate([costs, costs]),
        )
        self._keys = edge_keys(tails, heads)
        self._opposite = opposite_half_edges(piece.faces)

    def sides(self, start: int, end: int) -> tuple[BoolArray, float, FloatArray] | None:
        """(m,) sides of faces about the cheapest path between two vertices; its length, points.

        The length is the cost of the path where that is more.
        """
        piece = self._piece
        costs, before = self._graph.paths_from(end, start)
        path = path_back(before, start)
        if path[-1] != end:
            return None
        steps = np.array(path)
        sides = self._sides_of(steps)
        length = float(pm.norm(piece.points[steps[1:]] - piece.points[steps[:-1]], axis=1).sum())
        return (
            None if sides.all() else (sides, max(length, float(costs[start])), piece.points[steps])
        )

    def sides_near(
        self, starts: IntArray, ends: IntArray, path: FloatArray, plane: MirrorPlane
    ) -> BoolArray | None:
        """(m,) sides of faces about the path between two places nearest to an image of another."""
        mirror = PathMirror(plane, self._piece.points, self._graph)
        steps = mirror.nearest_image(path, starts, ends)
        sides = None if steps is None else self._sides_of(np.array(steps))
        return None if sides is None or sides.all() else sides

    def _sides_of(self, steps: LongArray) -> BoolArray:
        """(m,) which faces are on the side of the first, about a path of vertices."""
        piece = self._piece
        is_cut = np.isin(self._keys, edge_keys(steps[:-1], steps[1:]))
        edges = np.flatnonzero((self._opposite >= 0) & ~is_cut).astype(np.int32)
        labels = merged_labels(len(piece.faces), edges // 3, self._opposite[edges] // 3)
        return np.asarray(labels == labels[0])
