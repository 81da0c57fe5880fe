"""The cost of joining two neighboring charts, found by flattening them together."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.mapping.atlas.joining.glue import contact_of, glued, gluing_choices
from texbake.mapping.atlas.joining.piece import ChartPiece, relax_piece
from texbake.mesh.mesh import IntArray

# Cost of a merger that makes nothing worse; of these, the one that glues most of a border is first.
_LEAST_COST = 1e-3


# A chart below this share of the largest allowed area may also join a chart that is large enough.
_NEXT_TO_NOTHING = 0.02


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """How much worse joining may make the charts."""

    excess: float  # what may be added to the sum of area times (L2² - 1) over all charts
    # What may be added to the total area that charts leave empty in their convex hulls.
    waste: float
    chart_l2: float  # largest stretch of a joined chart
    chart_area: float  # largest area of a joined chart; tiny charts may always join
    # Greatest extent of a joined chart; it may also be as long as the longer of the two.
    chart_length: float

    def covers(self, merger: Merger) -> bool:
        """Whether a merger is allowed; one that makes nothing worse always is."""
        return (
            merger.excess <= max(self.excess, 0.0)
            and merger.waste <= max(self.waste, 0.0)
            and merger.piece.l2 <= self.chart_l2
        )

    def has_place(self, one: ChartPiece, other: ChartPiece) -> bool:
        """Whether two pieces are small enough to be joined."""
        whole, lesser = one.area + other.area, min(one.area, other.area)
        return whole <= self.chart_area or lesser <= _NEXT_TO_NOTHING * self.chart_area


@dataclass(frozen=True, kw_only=True, eq=False)
class Merger:
    """Two pieces flattened as one."""

    piece: ChartPiece  # the joined piece
    # excess, waste: what it adds to the sum of the two; see `Allowance`.
    excess: float
    waste: float
    share: float  # length along which they are glued, as a share of the shorter border

    def cost(self, scale: Allowance) -> float:
        """Share of the allowance that it uses, divided by the share that is glued."""
        excess = max(self.excess, 0.0) / scale.excess if scale.excess > 0.0 else 0.0
        waste = max(self.waste, 0.0) / scale.waste if scale.waste > 0.0 else 0.0
        return (excess + waste + _LEAST_COST) / self.share


def find_merger(
    one: ChartPiece, other: ChartPiece, opposite: IntArray, *, scale: Allowance, n_iterations: int
) -> Merger | None:
    """Flatten two pieces as one, in each way that they can be glued; return the cheapest.

    `opposite` (3 F,) int32: from `opposite_half_edges`. Returns None if they do not meet, or cannot
    be flattened together without flips or overlaps.
    """
    if one.area < other.area:
        one, other = other, one
    contact = contact_of(one, other, opposite)
    if contact is None or not scale.has_place(one, other):
        return None
    shorter = min(float(one.border_lengths.sum()), float(other.border_lengths.sum()))
    longest = max(scale.chart_length, one.length, other.length)
    best = None
    for way in gluing_choices(contact):
        union = glued(one, other, contact, way)
        length = float(contact.lengths[way].sum())
        if length == 0.0 or not union.is_disk:
            continue
        sketch = _merger(union, one, other, length / shorter)
        if sketch.waste > scale.waste or sketch.piece.length > longest:
            continue
        merger = relaxed_merger(sketch, one, other, n_iterations=n_iterations)
        if merger is not None and (best is None or merger.cost(scale) < best.cost(scale)):
            best = merger
    return best


def relaxed_merger(
    merger: Merger, one: ChartPiece, other: ChartPiece, *, n_iterations: int
) -> Merger | None:
    """Improve the layout of a merger; None if it then has flips or overlaps."""
    piece = relax_piece(merger.piece, n_iterations=n_iterations)
    return None if piece is None else _merger(piece, one, other, merger.share)


def _merger(piece: ChartPiece, one: ChartPiece, other: ChartPiece, share: float) -> Merger:
    return Merger(
        piece=piece,
        excess=piece.excess - one.excess - other.excess,
        waste=piece.waste - one.waste - other.waste,
        share=share,
    )
