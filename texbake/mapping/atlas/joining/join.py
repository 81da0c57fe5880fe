"""Neighboring charts joined, as long as the stretch of the mesh allows.

All pairs of charts that meet are candidates. Each candidate is actually flattened, roughly at first
and fully when it is next in line, and the cheapest is joined. The cost is the added stretch plus
the area that a chart leaves empty in its convex hull, since spread-out shapes pack badly, divided
by the share of its outline that the smaller chart loses, so that charts become round rather than
long. Where the seam that goes is costly, cost and added stretch count that much less. After a join,
the costs of its neighbors are computed when they are next in line.

Based on: P. Sander, J. Snyder, S. Gortler, H. Hoppe, "Texture mapping progressive meshes", 2001
(charts made by merging, in the order of their costs); M. Minoux, "Accelerated greedy algorithms
for maximizing submodular set functions", 1978 (costs recomputed only for the next in line).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.cutting.cut import STRIP_SIDES
from texbake.mapping.atlas.joining.counterparts import (
    JoinPlan,
    PlanKey,
    find_planned_merge,
    plan_join,
    relax_planned_merge,
)
from texbake.mapping.atlas.joining.pieces import ChartPiece, charts_of, compact_parts, pieces_of
from texbake.mapping.atlas.joining.stitch import ChartMerge, MergeTolerance
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

_GUESSED, _ROUGH, _FULL = 0, 3, 30  # iterations of `flatten` that a cost is based on
_BATCH = 8  # candidates flattened at the same time, for any number of threads

# Iterations over faces that any mesh may use: a few seconds.
_LEAST_WORK = 3_000_000

# Fixed cost of flattening two charts, in faces: with thousands of tiny charts little else counts.
_LEAST_FACES = 8

# Area that joined charts leave empty in their convex hulls, as a share of their own.
MOST_WASTE = 0.25

# Charts below this share of the mesh's area are not cut, whatever their shape.
_LEAST_CUT = 0.01


def join_charts(
    surface: ChartSurface,
    charts: Charts,
    *,
    weights: FloatArray | None = None,
    most_l2: float,
    most_chart_l2: float | None = None,
    most_share: float = 0.1,
    most_waste: float = MOST_WASTE,
    most_length: float = math.inf,
    most_work: int = 300,
    find_counterparts: Callable[[list[IntArray]], dict[int, int]] | None = None,
    only_pairs: bool = False,
) -> Charts:
    """Join neighboring charts, cheapest first, up to a share of the area of the mesh.

    `weights`: (F, 3) costs of seams by `edge_weights`: the costliest seams are removed first.
    `find_counterparts`: returns the index of each piece's mirror image, by the faces of pieces;
    joined charts stay mirror images of each other. `only_pairs`: join pieces to their mirror images
    only.
    """
    weights = np.ones((len(surface.faces), 3)) if weights is None else weights
    solid = charts.solid
    if not solid.any():
        return charts
    opposite = surface.opposite(solid)
    pieces = pieces_of(surface, charts, opposite)
    area = math.fsum(piece.area for piece in pieces)
    if find_counterparts is None:
        pieces = _compact(pieces, opposite, surface.polygons, area, most_waste)
    if most_chart_l2 is None:
        most_chart_l2 = max(1.0 + 3.0 * (most_l2 - 1.0), 1.1)
    allowed = MergeTolerance(
        excess=area * (most_l2**2 - 1.0),
        waste=area * most_waste,
        chart_l2=most_chart_l2,
        chart_area=area * most_share,
        chart_length=most_length * math.sqrt(area),
        strip_length=STRIP_SIDES * math.sqrt(area),
    )
    counterparts = None
    if find_counterparts is not None:
        counterparts = find_counterparts([piece.face_ids for piece in pieces])
    joining = _Joining(
        pieces, opposite, weights.ravel(), allowed, counterparts, only_pairs, surface.threads
    )
    joining.run(max(most_work * int(solid.sum()), _LEAST_WORK))
    return charts_of(list(joining.pieces.values()), charts)


def _compact(
    pieces: list[ChartPiece],
    opposite: IntArray,
    polygons: IntArray | None,
    area: float,
    most_waste: float,
) -> list[ChartPiece]:
    """Cut pieces of a surface with this area until their hulls have little empty area."""
    return [
        part
        for piece in pieces
        for part in compact_parts(
            piece, opposite, polygons, most_waste=most_waste, least_area=_LEAST_CUT * area
        )
    ]


def compact_charts(surface: ChartSurface, charts: Charts) -> Charts:
    """Cut sprawling charts, as `join_charts` does before it joins charts."""
    opposite = surface.opposite(charts.solid)
    pieces = pieces_of(surface, charts, opposite)
    area = math.fsum(piece.area for piece in pieces)
    return charts_of(_compact(pieces, opposite, surface.polygons, area, MOST_WASTE), charts)


@dataclass(eq=False)
class _Candidate:
    """Two pieces, the cost of joining them, and the iterations that the cost is based on."""

    one: int
    other: int
    plan: JoinPlan
    cost: float = 0.0
    effort: int = _GUESSED
    merge: ChartMerge | None = None

    def __lt__(self, than: _Candidate) -> bool:
        return (self.cost, self.one, self.other) < (than.cost, than.one, than.other)


class _Joining:
    """The pieces so far, which of them meet, and the candidates in the order of their costs."""

    def __init__(
        self,
        pieces: list[ChartPiece],
        opposite: IntArray,
        weights: FloatArray,
        allowed: MergeTolerance,
        counterparts: dict[int, int] | None,
        only_pairs: bool,
        threads: int | None,
    ) -> None:
        self.pieces = dict(enumerate(pieces))
        self._counterparts, self._only_pairs = counterparts, only_pairs
        self._opposite, self._weights = opposite, weights
        self._threads = threads
        self._owners = np.full(len(opposite) // 3, -1, dtype=np.int32)
        for index, piece in self.pieces.items():
            self._owners[piece.face_ids] = index
        self._allowed = allowed
        self._next_index = len(pieces)
        self._excess = math.fsum(piece.excess for piece in pieces)
        self._waste = math.fsum(piece.waste for piece in pieces)
        self._costs: dict[int, dict[int, float]] = {index: {} for index in self.pieces}
        self._queue: list[_Candidate] = []
        self._waiting: list[_Candidate] = []
        self._work = 0

    def run(self, most_work: int) -> None:
        """Join until nothing can be joined any more, or `most_work` is used up."""
        candidates: dict[PlanKey, _Candidate] = {}
        for index in self.pieces:
            for other in self._neighbors(index):
                candidate = self._candidate(index, other)
                if candidate.plan.is_pair or not self._only_pairs:
                    candidates.setdefault(candidate.plan.key, candidate)
        self._look_at(list(candidates.values()), _ROUGH)
        while self._queue and self._work < most_work:
            joined = False
            while self._queue and self._work < most_work:
                joined |= self._join_next()
            if joined:
                # Joins that were too expensive or impossible may be possible now.
                self._queue, self._waiting = self._waiting, []
                heapq.heapify(self._queue)

    def _candidate(self, one: int, other: int, cost: float = 0.0) -> _Candidate:
        return _Candidate(one, other, plan_join(one, other, self._counterparts), cost=cost)

    def _room(self) -> MergeTolerance:
        """What is left of the allowance."""
        return replace(
            self._allowed,
            excess=self._allowed.excess - self._excess,
            waste=self._allowed.waste - self._waste,
        )

    def _join_next(self) -> bool:
        """Flatten the cheapest candidates that have no piece in common, and join the cheapest."""
        chosen = self._cheapest()
        by_effort: dict[int, list[_Candidate]] = {_GUESSED: [], _ROUGH: [], _FULL: []}
        for candidate in chosen:
            by_effort[candidate.effort].append(candidate)
        self._look_at(by_effort[_GUESSED], _ROUGH)
        self._look_at(by_effort[_ROUGH], _FULL)
        for candidate in by_effort[_FULL]:
            heapq.heappush(self._queue, candidate)
        joined = False
        while self._queue and self._queue[0].effort == _FULL:
            candidate = heapq.heappop(self._queue)
            if not self._is_current(candidate):
                continue
            if self._renew(candidate):
                heapq.heappush(self._queue, candidate)
                continue
            assert candidate.merge is not None
            if self._room().covers(candidate.merge):
                self._join(candidate.plan, candidate.merge)
                joined = True
            else:
                self._waiting.append(candidate)
        return joined

    def _cheapest(self) -> list[_Candidate]:
        """Take a batch of candidates from the queue."""
        chosen: list[_Candidate] = []
        later: list[_Candidate] = []
        touched: set[int] = set()
        while self._queue and len(chosen) < _BATCH and len(later) < _BATCH:
            candidate = heapq.heappop(self._queue)
            if not self._is_current(candidate):
                continue
            self._renew(candidate)
            free = touched.isdisjoint(candidate.plan.members)
            (chosen if free else later).append(candidate)
            touched.update(candidate.plan.members)
        for candidate in later:
            heapq.heappush(self._queue, candidate)
        return chosen

    def _is_current(self, candidate: _Candidate) -> bool:
        return candidate.one in self.pieces and candidate.other in self.pieces

    def _renew(self, candidate: _Candidate) -> bool:
        """Plan a candidate again; return whether its plan, and so its layout, is out of date."""
        plan = plan_join(candidate.one, candidate.other, self._counterparts)
        changed = plan != candidate.plan
        if changed:
            candidate.plan, candidate.effort, candidate.merge = plan, _GUESSED, None
        return changed

    def _look_at(self, candidates: list[_Candidate], n_iterations: int) -> None:
        """Compute the costs of candidates, and queue those that can be joined."""

        def look(start: int, stop: int) -> None:
            for candidate in candidates[start:stop]:
                if candidate.merge is None:
                    candidate.merge = find_planned_merge(
                        self.pieces,
                        candidate.plan,
                        self._opposite,
                        self._weights,
                        scale=self._allowed,
                        n_iterations=n_iterations,
                    )
                else:
                    candidate.merge = relax_planned_merge(
                        candidate.merge, self.pieces, candidate.plan, n_iterations=n_iterations
                    )

        run_bands(look, len(candidates), band=1, threads=self._threads)
        for candidate in candidates:
            candidate.effort = n_iterations
            merge = candidate.merge
            candidate.cost = math.inf if merge is None else merge.cost(self._allowed)
            for one, other, *_ in candidate.plan.groups:
                self._costs[one][other] = self._costs[other][one] = candidate.cost
            sizes = [len(self.pieces[index].faces) for index in candidate.plan.members]
            self._work += n_iterations * (sum(sizes) + _LEAST_FACES)
            if merge is not None:
                heapq.heappush(self._queue, candidate)

    def _neighbors(self, index: int) -> list[int]:
        across = self._opposite[self.pieces[index].border]
        owners = np.unique(self._owners[across[across >= 0] // 3])
        return [int(owner) for owner in owners if owner != index]

    def _join(self, plan: JoinPlan, merge: ChartMerge) -> None:
        """Replace pieces by their unions, whose candidates begin with the costs of the pieces."""
        unions = merge.unions
        known = [self._costs.pop(gone) for gone in plan.members]
        for gone in plan.members:
            del self.pieces[gone]
        indices = list(range(self._next_index, self._next_index + len(unions)))
        self._next_index += len(unions)
        self._excess += merge.excess / merge.weight
        self._waste += merge.waste
        for index, piece in zip(indices, unions, strict=True):
            self.pieces[index] = piece
            self._owners[piece.face_ids] = index
            self._costs[index] = {}
        self._pair(plan, indices)
        if self._only_pairs:
            return
        new: dict[PlanKey, _Candidate] = {}
        for index in indices:
            for neighbor in self._neighbors(index):
                guess = min(costs.get(neighbor, math.inf) for costs in known)
                self._costs[index][neighbor] = self._costs[neighbor][index] = guess
                candidate = self._candidate(neighbor, index, guess)
                new.setdefault(candidate.plan.key, candidate)
        for candidate in new.values():
            if candidate.cost < math.inf:
                heapq.heappush(self._queue, candidate)
            else:
                self._waiting.append(candidate)

    def _pair(self, plan: JoinPlan, indices: Sequence[int]) -> None:
        """Set the counterparts of unions."""
        if self._counterparts is None:
            return
        for gone in plan.members:
            self._counterparts.pop(gone, None)
        if plan.counterpart == "self":
            self._counterparts[indices[0]] = indices[0]
        elif plan.counterpart == "other":
            self._counterparts[indices[0]], self._counterparts[indices[1]] = indices[1], indices[0]
        elif isinstance(plan.counterpart, int):
            self._counterparts[indices[0]] = plan.counterpart
            self._counterparts[plan.counterpart] = indices[0]
