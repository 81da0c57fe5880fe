"""Joins that keep charts mirror images of one another: both of a pair, or a pair in the middle.

The counterpart of a piece is the piece that is its mirror image. A piece in the middle is its own
counterpart, and a piece without a mirror image has none. Joining two pieces also joins their
counterparts. A piece and its counterpart join to a piece in the middle; a piece in the middle joins
both pieces of a pair at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from texbake.mapping.atlas.joining.pieces import ChartPiece, relax_piece
from texbake.mapping.atlas.joining.stitch import ChartMerge, MergeTolerance, find_merge
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.records import dataclass

# A chart in the middle may be larger by this factor: two halves would need one more seam. The other
# factor holds where it is joined at a hard edge, whose weight is below the last number.
_MIDDLE, _MIDDLE_HARD, _HARD = 5.0, 2.5, 0.5
_MOST_WEIGHT = 16.0  # of an edge, in units of the mean
# Factor on the cost of joining a piece and its counterpart, whose seam would run down the middle.
_PAIR_COST = 0.3


PlanKey: TypeAlias = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class JoinPlan:
    """Which pieces are joined together, by index."""

    # Groups of pieces that each become one, in the order of their joining.
    groups: tuple[tuple[int, ...], ...]
    # Counterpart of the first union: "self", "other" for the second union, "none", or the index of
    # a piece that is not joined.
    counterpart: str | int

    @property
    def members(self) -> tuple[int, ...]:
        """All pieces."""
        return tuple(index for group in self.groups for index in group)

    @property
    def is_pair(self) -> bool:
        """Whether a piece joins its mirror image."""
        return self.counterpart == "self" and len(self.members) == 2

    @property
    def key(self) -> PlanKey:
        """Equal for plans that join the same pieces."""
        return tuple(sorted(tuple(sorted(group)) for group in self.groups))


def plan_join(one: int, other: int, counterparts: Mapping[int, int] | None) -> JoinPlan:
    """Plan to join two pieces; `counterparts`: by the index of each piece that has one."""
    if counterparts is None:
        return JoinPlan(((one, other),), "none")
    first, second = counterparts.get(one), counterparts.get(other)
    if first == other:
        return JoinPlan(((one, other),), "self")
    if first is None or second is None:
        counterpart = second if first is None else first
        if counterpart is None:
            return JoinPlan(((one, other),), "none")
        return JoinPlan(((one, other),), "self" if counterpart in (one, other) else counterpart)
    if first == one:
        group = (one, other) if second == other else (one, other, second)
        return JoinPlan((group,), "self")
    if second == other:
        return JoinPlan(((other, one, first),), "self")
    return JoinPlan(((one, other), (first, second)), "other")


def find_planned_merge(
    pieces: Mapping[int, ChartPiece],
    plan: JoinPlan,
    opposite: IntArray,
    weights: FloatArray,
    *,
    scale: MergeTolerance,
    n_iterations: int,
) -> ChartMerge | None:
    """Flatten the unions of a plan; None if one of the joins is impossible."""
    if plan.counterpart == "self":
        one, other = (pieces[index] for index in plan.groups[0][:2])
        is_hard = _mean_weight(one, other, opposite, weights) < _HARD
        factor = _MIDDLE_HARD if is_hard else _MIDDLE
        scale = replace(scale, chart_area=factor * scale.chart_area)
    merges: list[ChartMerge] = []
    unions = []
    seams: list[float] = []  # their mean weights
    for group in plan.groups:
        piece = pieces[group[0]]
        for index in group[1:]:
            merge = find_merge(
                piece, pieces[index], opposite, weights, scale=scale, n_iterations=n_iterations
            )
            if merge is None:
                return None
            merges.append(merge)
            seams.append(_mean_weight(piece, pieces[index], opposite, weights))
            piece = merge.unions[0]
        unions.append(piece)
    return ChartMerge(
        unions=tuple(unions),
        excess=sum(merge.excess for merge in merges),
        waste=sum(merge.waste for merge in merges),
        share=sum(merge.share for merge in merges),
        factor=_PAIR_COST if len(merges) == 1 and plan.counterpart == "self" else 1.0,
        weight=max(sum(seams) / len(seams), 1.0),
    )


def _mean_weight(
    one: ChartPiece, other: ChartPiece, opposite: IntArray, weights: FloatArray
) -> float:
    """Mean weight of the edges at which two pieces meet."""
    across = opposite[one.border]
    at = np.minimum(np.searchsorted(other.border, across), len(other.border) - 1)
    met = one.border[other.border[at] == across]
    return float(np.minimum(weights[met], _MOST_WEIGHT).mean()) if len(met) else 0.0


def relax_planned_merge(
    merge: ChartMerge, pieces: Mapping[int, ChartPiece], plan: JoinPlan, *, n_iterations: int
) -> ChartMerge | None:
    """Improve the layout of a merge; None if it has flips, overlaps or a crushed face."""
    unions = []
    for piece in merge.unions:
        relaxed = relax_piece(piece, n_iterations=n_iterations)
        if relaxed is None:
            return None
        unions.append(relaxed)
    before = [pieces[index] for index in plan.members]
    if any(piece.is_crushed(before) for piece in unions):
        return None
    return replace(
        merge,
        unions=tuple(unions),
        excess=sum(piece.excess for piece in unions) - sum(piece.excess for piece in before),
        waste=sum(piece.waste for piece in unions) - sum(piece.waste for piece in before),
    )
