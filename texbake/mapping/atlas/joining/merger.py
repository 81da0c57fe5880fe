"""What it costs to make two neighboring charts one, found by laying them flat together."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.mapping.atlas.joining.glue import contact_of, glued, ways_to_glue
from texbake.mapping.atlas.joining.piece import Piece, relaxed_piece
from texbake.mesh.mesh import IntArray

# Cost of a merger that adds nothing; of such, those come first that glue most of a border.
_LEAST_COST = 1e-3


# A chart of this share of the area that one may have joins also a chart that is large enough.
_NEXT_TO_NOTHING = 0.02


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """How much worse charts may get by joining them.

    Attributes
    ----------
    excess : float
        Sum of area times (L2² - 1), over all charts, that may be added.
    waste : float
        Sum of the area within their convex hulls that charts do not cover, that may be added.
    chart_l2 : float
        Most stretch of a joined chart.
    chart_area : float
        Most area of a joined chart, but for what is next to nothing of that.
    """

    excess: float
    waste: float
    chart_l2: float
    chart_area: float

    def covers(self, merger: Merger) -> bool:
        """Whether it is enough for a merger; one that makes nothing worse is always covered."""
        return (
            merger.excess <= max(self.excess, 0.0)
            and merger.waste <= max(self.waste, 0.0)
            and merger.piece.l2 <= self.chart_l2
        )

    def has_place(self, one: Piece, other: Piece) -> bool:
        """Whether two pieces are not too large to be joined."""
        whole, lesser = one.area + other.area, min(one.area, other.area)
        return whole <= self.chart_area or lesser <= _NEXT_TO_NOTHING * self.chart_area


@dataclass(frozen=True, kw_only=True, eq=False)
class Merger:
    """Two pieces laid flat as one.

    Attributes
    ----------
    piece : Piece
        What they become.
    excess, waste : float
        What it has more than the two together; see `Allowance`.
    share : float
        Length along which they are glued, as a share of the shorter of their borders.
    """

    piece: Piece
    excess: float
    waste: float
    share: float

    def cost(self, scale: Allowance) -> float:
        """Shares that it uses up of what is allowed in all, over the share that is glued."""
        excess = max(self.excess, 0.0) / scale.excess if scale.excess > 0.0 else 0.0
        waste = max(self.waste, 0.0) / scale.waste if scale.waste > 0.0 else 0.0
        return (excess + waste + _LEAST_COST) / self.share


def find_merger(
    one: Piece, other: Piece, opposite: IntArray, *, scale: Allowance, n_iterations: int
) -> Merger | None:
    """Lay two pieces flat as one, in each way that they can be glued; return the cheapest.

    Parameters
    ----------
    one, other : Piece
    opposite : (3 F,) int32
        From `opposite_half_edges`.
    scale : Allowance
        What is allowed in all. A way that is sure to need more is not looked at.
    n_iterations : int
        Of `flatten`.

    Returns
    -------
    Merger or None
        None where they do not meet, or cannot lie in the plane together without flips or overlaps.
    """
    if one.area < other.area:
        one, other = other, one
    contact = contact_of(one, other, opposite)
    if contact is None or not scale.has_place(one, other):
        return None
    shorter = min(float(one.border_lengths.sum()), float(other.border_lengths.sum()))
    best = None
    for way in ways_to_glue(contact):
        union = glued(one, other, contact, way)
        length = float(contact.lengths[way].sum())
        if length == 0.0 or not union.is_disk:
            continue
        sketch = _merger(union, one, other, length / shorter)
        if sketch.waste > scale.waste:
            continue
        merger = relaxed_merger(sketch, one, other, n_iterations=n_iterations)
        if merger is not None and (best is None or merger.cost(scale) < best.cost(scale)):
            best = merger
    return best


def relaxed_merger(merger: Merger, one: Piece, other: Piece, *, n_iterations: int) -> Merger | None:
    """Lay a merger out better, from where it lies; None where it has flips or overlaps then."""
    piece = relaxed_piece(merger.piece, n_iterations=n_iterations)
    return None if piece is None else _merger(piece, one, other, merger.share)


def _merger(piece: Piece, one: Piece, other: Piece, share: float) -> Merger:
    return Merger(
        piece=piece,
        excess=piece.excess - one.excess - other.excess,
        waste=piece.waste - one.waste - other.waste,
        share=share,
    )
