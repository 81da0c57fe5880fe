"""Two neighboring charts stitched into one: where they may be stitched, and what it costs.

Neighbors meet along paths of edges. Vertices inside a path become inner vertices of the joined
chart, so that any difference of their angle from a full turn becomes stretch. Where that is large,
as at the corner of a cube, it is better to stitch the path only up to that vertex. The cost is
found by flattening both charts together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.atlas.joining.pieces import ChartPiece, hull_area, relax_piece
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray

# Largest difference between the angle around a vertex and a full turn for stitching across it.
_MOST_DEFECT = math.radians(25.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Contact:
    """The half-edges along which two pieces, `one` and `other`, meet."""

    # at_one, at_other: (k,) int64; their positions in the borders of the pieces, in the order of
    # paths.
    at_one: npt.NDArray[np.int64]
    at_other: npt.NDArray[np.int64]
    paths: IntArray  # (k,) int32; the path that each belongs to
    lengths: FloatArray  # (k,) float64; lengths in space
    # (k,) float64; angle, in radians, that the vertex at the start of the half-edge would have
    # inside the joined chart; NaN at the start of a path.
    turns: FloatArray


def find_contact(one: ChartPiece, other: ChartPiece, opposite: IntArray) -> Contact | None:
    """Find where two pieces meet; None if they do not."""
    across = opposite[one.border]
    slots = np.minimum(np.searchsorted(other.border, across), len(other.border) - 1)
    at_one = np.flatnonzero(other.border[slots] == across)
    if len(at_one) == 0:
        return None
    at_other = slots[at_one]
    starts = np.stack([one.border_ends[at_one, 0], other.border_ends[at_other, 1]], axis=1)
    ends = np.stack([one.border_ends[at_one, 1], other.border_ends[at_other, 0]], axis=1)
    order, paths, goes_on = _chained(starts, ends)
    from_one, from_other = starts[order].T
    return Contact(
        at_one=at_one[order],
        at_other=at_other[order],
        paths=paths,
        lengths=pm.norm(one.points[ends[order, 0]] - one.points[starts[order, 0]], axis=1),
        turns=np.where(goes_on, one.angles[from_one] + other.angles[from_other], np.nan),
    )


def _chained(
    starts: IntArray, ends: IntArray
) -> tuple[npt.NDArray[np.int64], IntArray, npt.NDArray[np.bool_]]:
    """Order half-edges by paths; also return the path of each, and whether another precedes it.

    A closed path starts at its first half-edge, which its last one precedes.
    """
    slots = {start: i for i, start in enumerate(map(tuple, starts.tolist()))}
    following = [slots.get(end, -1) for end in map(tuple, ends.tolist())]
    has_previous = np.zeros(len(starts), dtype=bool)
    has_previous[[i for i in following if i >= 0]] = True
    seen = [False] * len(starts)
    order: list[int] = []
    paths: list[int] = []
    n_paths = 0
    for first in [*np.flatnonzero(~has_previous).tolist(), *range(len(starts))]:
        if seen[first]:
            continue
        at = first
        while at >= 0 and not seen[at]:
            seen[at] = True
            order.append(at)
            paths.append(n_paths)
            at = following[at]
        n_paths += 1
    chosen = np.array(order, dtype=np.int64)
    return chosen, np.array(paths, dtype=np.int32), has_previous[chosen]


def stitch_choices(contact: Contact) -> list[npt.NDArray[np.int64]]:
    """Choices of half-edges to stitch along a contact, the longest first.

    They are: all half-edges; the longest path; and the longest stretch of a path that passes no
    vertex whose angle is far from a full turn. Equal choices are given once.
    """
    k = len(contact.paths)
    new_path = np.diff(contact.paths, prepend=-1) != 0
    sharp = ~(np.abs(contact.turns - 2.0 * math.pi) <= _MOST_DEFECT)  # true for NaN
    ways = [np.arange(k)]
    for breaks in (new_path, new_path | sharp):
        runs = np.cumsum(breaks) - 1
        longest = np.flatnonzero(runs == int(np.argmax(np.bincount(runs, contact.lengths))))
        if len(longest) < len(ways[-1]):
            ways.append(longest)
    return ways


def stitch(
    one: ChartPiece, other: ChartPiece, contact: Contact, way: npt.NDArray[np.int64]
) -> ChartPiece:
    """Stitch two pieces along some half-edges of their contact.

    `other` is rotated and moved to fit the border of `one` best; stitched vertices are halfway.
    The result may have flips, its `l2` is NaN (unknown), and its hull area is approximate.
    """
    n_one = len(one.points)
    ends_one = one.border_ends[contact.at_one[way]]
    ends_other = other.border_ends[contact.at_other[way]][:, ::-1]
    labels = merged_labels(n_one + len(other.points), ends_one.ravel(), ends_other.ravel() + n_one)
    counts = np.bincount(labels)
    moved = _fitted(other.uvs, other.uvs[ends_other], one.uvs[ends_one], contact.lengths[way])
    uvs = np.concatenate([one.uvs, moved])
    means = [np.bincount(labels, uvs[:, axis]) / counts for axis in (0, 1)]
    points = np.empty((len(counts), 3))
    points[labels] = np.concatenate([one.points, other.points])
    border, ends = _open_border(one, other, contact, way, labels)
    face_ids = np.concatenate([one.face_ids, other.face_ids])
    order = np.argsort(face_ids, kind="stable")
    return ChartPiece(
        face_ids=face_ids[order],
        faces=labels[np.concatenate([one.faces, other.faces + np.int32(n_one)])[order]],
        points=points,
        uvs=np.stack(means, axis=1),
        angles=np.asarray(
            np.bincount(labels, np.concatenate([one.angles, other.angles])), dtype=np.float64
        ),
        border=border,
        border_ends=ends,
        area=one.area + other.area,
        l2=math.nan,
        hull_area=hull_area(uvs),
    )


def _open_border(
    one: ChartPiece,
    other: ChartPiece,
    contact: Contact,
    way: npt.NDArray[np.int64],
    labels: IntArray,
) -> tuple[IntArray, IntArray]:
    """Border of the stitched piece, and the ends of its half-edges.

    A hole of two edges between the same two vertices closes.
    """
    keep_one, keep_other = np.ones(len(one.border), bool), np.ones(len(other.border), bool)
    keep_one[contact.at_one[way]] = False
    keep_other[contact.at_other[way]] = False
    border = np.concatenate([one.border[keep_one], other.border[keep_other]])
    ends = np.concatenate(
        [one.border_ends[keep_one], other.border_ends[keep_other] + np.int32(len(one.points))]
    )
    ends = labels[ends]
    keys = ends[:, 0].astype(np.int64) << 32 | ends[:, 1]
    back = ends[:, 1].astype(np.int64) << 32 | ends[:, 0]
    is_open = ~np.isin(back, keys)
    border, ends = border[is_open], ends[is_open]
    order = np.argsort(border, kind="stable")
    return border[order], ends[order]


def _fitted(
    uvs: FloatArray, sources: FloatArray, targets: FloatArray, lengths: FloatArray
) -> FloatArray:
    """Rotate and move coordinates so that edges (k, 2, 2) fit others best, weighted by length.

    Based on: P. Schönemann, "A generalized solution of the orthogonal Procrustes problem", 1966.
    """
    weights = np.repeat(lengths, 2)
    weights = (
        weights / weights.sum() if weights.sum() > 0.0 else np.full(len(weights), 1 / len(weights))
    )
    source, target = sources.reshape(-1, 2), targets.reshape(-1, 2)
    source_mean, target_mean = ((weights[:, None] * ends).sum(axis=0) for ends in (source, target))
    (x, y), (s, t) = (source - source_mean).T, (target - target_mean).T
    cos, sin = float((weights * (x * s + y * t)).sum()), float((weights * (x * t - y * s)).sum())
    length = pm.hypot(cos, sin)
    cos, sin = (cos / length, sin / length) if length > 0.0 else (1.0, 0.0)
    turn = np.array([[cos, sin], [-sin, cos]])
    return np.asarray(pm.matmul(uvs - source_mean, turn) + target_mean)


# Cost of a merge that makes nothing worse; the one that stitches most of a border is then first.
_LEAST_COST = 1e-3


# A chart below this share of the largest allowed area may also join a chart that is large enough.
_NEXT_TO_NOTHING = 0.02


@dataclass(frozen=True, kw_only=True)
class MergeTolerance:
    """How much worse joining may make the charts."""

    excess: float  # what may be added to the sum of area times (L2² - 1) over all charts
    # What may be added to the total area that charts leave empty in their convex hulls.
    waste: float
    chart_l2: float  # largest stretch of a joined chart
    chart_area: float  # largest area of a joined chart; tiny charts may always join
    # Greatest extent of a joined chart; it may also be as long as the longer of the two.
    chart_length: float

    def covers(self, merge: ChartMerge) -> bool:
        """Whether a merge is allowed; one that makes nothing worse always is."""
        return (
            merge.excess <= max(self.excess, 0.0)
            and merge.waste <= max(self.waste, 0.0)
            and merge.piece.l2 <= self.chart_l2
        )

    def has_place(self, one: ChartPiece, other: ChartPiece) -> bool:
        """Whether two pieces are small enough to be joined."""
        whole, lesser = one.area + other.area, min(one.area, other.area)
        return whole <= self.chart_area or lesser <= _NEXT_TO_NOTHING * self.chart_area


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartMerge:
    """Two pieces flattened as one."""

    piece: ChartPiece  # the joined piece
    # excess, waste: what it adds to the sum of the two; see `MergeTolerance`.
    excess: float
    waste: float
    share: float  # length along which they are stitched, as a share of the shorter border

    def cost(self, scale: MergeTolerance) -> float:
        """Share of the allowance that it uses, divided by the share that is stitched."""
        excess = max(self.excess, 0.0) / scale.excess if scale.excess > 0.0 else 0.0
        waste = max(self.waste, 0.0) / scale.waste if scale.waste > 0.0 else 0.0
        return (excess + waste + _LEAST_COST) / self.share


def find_merge(
    one: ChartPiece,
    other: ChartPiece,
    opposite: IntArray,
    *,
    scale: MergeTolerance,
    n_iterations: int,
) -> ChartMerge | None:
    """Flatten two pieces as one, in each way that they can be stitched; return the cheapest.

    `opposite` (3 F,) int32: from `opposite_half_edges`. Returns None if they do not meet, or cannot
    be flattened together without flips or overlaps.
    """
    if one.area < other.area:
        one, other = other, one
    contact = find_contact(one, other, opposite)
    if contact is None or not scale.has_place(one, other):
        return None
    shorter = min(float(one.border_lengths.sum()), float(other.border_lengths.sum()))
    longest = max(scale.chart_length, one.length, other.length)
    best = None
    for way in stitch_choices(contact):
        union = stitch(one, other, contact, way)
        length = float(contact.lengths[way].sum())
        if length == 0.0 or not union.is_disk:
            continue
        sketch = _chart_merge(union, one, other, length / shorter)
        if sketch.waste > scale.waste or sketch.piece.length > longest:
            continue
        merge = relax_merge(sketch, one, other, n_iterations=n_iterations)
        if merge is not None and (best is None or merge.cost(scale) < best.cost(scale)):
            best = merge
    return best


def relax_merge(
    merge: ChartMerge, one: ChartPiece, other: ChartPiece, *, n_iterations: int
) -> ChartMerge | None:
    """Improve the layout of a merge; None if it then has flips or overlaps."""
    piece = relax_piece(merge.piece, n_iterations=n_iterations)
    return None if piece is None else _chart_merge(piece, one, other, merge.share)


def _chart_merge(piece: ChartPiece, one: ChartPiece, other: ChartPiece, share: float) -> ChartMerge:
    return ChartMerge(
        piece=piece,
        excess=piece.excess - one.excess - other.excess,
        waste=piece.waste - one.waste - other.waste,
        share=share,
    )
