"""Joins that keep charts mirror images of one another: both of a pair, or a pair in the middle.

A piece has a mate, the piece that is its mirror image; a piece in the middle is its own mate, and a
piece without a mirror image has none. Joining two pieces also joins their mates. Two mates become a
piece in the middle, and such a piece takes both of a pair.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

from texbake.mapping.atlas.joining.pieces import ChartPiece, relax_piece
from texbake.mapping.atlas.joining.stitch import (
    ChartMerge,
    MergeTolerance,
    find_merge,
    merge_cost,
    relax_merge,
)
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.records import dataclass

# A chart in the middle may be larger by this factor: it has a seam less than the two halves.
_MIDDLE = 2.5
# Cost of joining two mates, whose seam would run down the middle, as a share of that of others.
_MATES_COST = 0.3


PlanKey: TypeAlias = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class JoinPlan:
    """Which pieces are joined together, by index."""

    # Groups of pieces that each become one, in the order of their joining.
    groups: tuple[tuple[int, ...], ...]
    # The mate of the first joined piece: "self", "other" for the second one, "none", or the index
    # of a piece that is not joined.
    mate: str | int

    @property
    def members(self) -> tuple[int, ...]:
        """All pieces."""
        return tuple(index for group in self.groups for index in group)

    @property
    def key(self) -> PlanKey:
        """The same for plans that join the same pieces."""
        return tuple(sorted(tuple(sorted(group)) for group in self.groups))


def plan_join(one: int, other: int, mates: Mapping[int, int] | None) -> JoinPlan:
    """Which pieces are joined if two are; `mates`: of each index, without those that have none."""
    if mates is None:
        return JoinPlan(((one, other),), "none")
    first, second = mates.get(one), mates.get(other)
    if first == other:
        return JoinPlan(((one, other),), "self")
    if first is None or second is None:
        mate = second if first is None else first
        if mate is None:
            return JoinPlan(((one, other),), "none")
        return JoinPlan(((one, other),), "self" if mate in (one, other) else mate)
    if first == one:
        group = (one, other) if second == other else (one, other, second)
        return JoinPlan((group,), "self")
    if second == other:
        return JoinPlan(((other, one, first),), "self")
    return JoinPlan(((one, other), (first, second)), "other")


@dataclass(frozen=True, eq=False)
class MatesMerge:
    """Pieces flattened as one or as a pair; see `ChartMerge`."""

    made: tuple[ChartPiece, ...]
    excess: float
    waste: float
    share: float
    favored: float

    @property
    def l2(self) -> float:
        """The larger stretch of a joined chart."""
        return max(piece.l2 for piece in self.made)

    def cost(self, scale: MergeTolerance) -> float:
        """Share of the allowance that it uses, divided by the share that is stitched."""
        return self.favored * merge_cost(self.excess, self.waste, self.share, scale)


def find_mates_merge(
    pieces: Mapping[int, ChartPiece],
    plan: JoinPlan,
    opposite: IntArray,
    weights: FloatArray,
    *,
    scale: MergeTolerance,
    n_iterations: int,
) -> ChartMerge | MatesMerge | None:
    """Flatten the pieces of a plan as it says; None if one of the joins is impossible."""
    if plan.mate == "self":
        scale = replace(scale, chart_area=_MIDDLE * scale.chart_area)
    merges: list[ChartMerge] = []
    made = []
    for group in plan.groups:
        piece = pieces[group[0]]
        for index in group[1:]:
            merge = find_merge(
                piece, pieces[index], opposite, weights, scale=scale, n_iterations=n_iterations
            )
            if merge is None:
                return None
            merges.append(merge)
            piece = merge.piece
        made.append(piece)
    if len(merges) == 1 and plan.mate != "self":
        return merges[0]
    return MatesMerge(
        tuple(made),
        sum(merge.excess for merge in merges),
        sum(merge.waste for merge in merges),
        sum(merge.share for merge in merges),
        _MATES_COST if len(merges) == 1 else 1.0,
    )


def relax_mates_merge(
    merge: ChartMerge | MatesMerge,
    pieces: Mapping[int, ChartPiece],
    plan: JoinPlan,
    *,
    n_iterations: int,
) -> ChartMerge | MatesMerge | None:
    """Improve the layout of a merge; None if it then has flips or overlaps."""
    if isinstance(merge, ChartMerge):
        one, other = plan.members
        return relax_merge(merge, pieces[one], pieces[other], n_iterations=n_iterations)
    made = []
    for piece in merge.made:
        relaxed = relax_piece(piece, n_iterations=n_iterations)
        if relaxed is None:
            return None
        made.append(relaxed)
    before = [pieces[index] for index in plan.members]
    return replace(
        merge,
        made=tuple(made),
        excess=sum(piece.excess for piece in made) - sum(piece.excess for piece in before),
        waste=sum(piece.waste for piece in made) - sum(piece.waste for piece in before),
    )
