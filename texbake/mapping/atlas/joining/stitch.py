"""Two neighboring charts stitched into one: how much worse that may be, and what it costs.

Kernel: `core/chart_stitching.c`, which says where charts are stitched.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.joining.pieces import ChartPiece
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.records import dataclass

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
    strip_length: float  # a longer piece joins only pieces at least half as long as itself

    def covers(self, merge: ChartMerge) -> bool:
        """Whether a merge is allowed; one that makes nothing worse always is."""
        return (
            merge.excess / merge.weight <= max(self.excess, 0.0)
            and merge.waste <= max(self.waste, 0.0)
            and merge.l2 <= self.chart_l2
        )

    def has_place(self, one: ChartPiece, other: ChartPiece) -> bool:
        """Whether two pieces are small enough to be joined, and neither is a strip far longer."""
        longer, shorter = max(one.length, other.length), min(one.length, other.length)
        if longer > self.strip_length and shorter < longer / 2.0:
            return False
        whole, lesser = one.area + other.area, min(one.area, other.area)
        return whole <= self.chart_area or lesser <= _NEXT_TO_NOTHING * self.chart_area


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartMerge:
    """Two or more pieces flattened as one, or as two that mirror each other."""

    unions: tuple[ChartPiece, ...]  # the joined pieces
    # excess, waste: what the merge adds to the sums over its pieces; see `MergeTolerance`.
    excess: float
    waste: float
    share: float  # weighted length along which they are stitched, in lengths of the shorter border
    factor: float = 1.0  # on the cost
    # Mean cost of the seam that goes, for its length, or 1 if that is more; stretch counts as much
    # less.
    weight: float = 1.0

    @property
    def l2(self) -> float:
        """L2 stretch of the union that stretches most."""
        return max(piece.l2 for piece in self.unions)

    def cost(self, scale: MergeTolerance) -> float:
        """Share of the allowance that the merge uses, divided by the share that is stitched."""
        excess = max(self.excess, 0.0) / scale.excess if scale.excess > 0.0 else 0.0
        waste = max(self.waste, 0.0) / scale.waste if scale.waste > 0.0 else 0.0
        return (self.factor / self.weight) * ((excess + waste + _LEAST_COST) / self.share)


def find_merge(
    one: ChartPiece,
    other: ChartPiece,
    opposite: IntArray,
    weights: FloatArray,
    *,
    scale: MergeTolerance,
    n_iterations: int,
) -> ChartMerge | None:
    """Flatten two pieces as one in each way of stitching; return the cheapest, None if none.

    `weights`: (3 F,) float64; what a seam along each half-edge costs, for its length.
    """
    if one.area < other.area:
        one, other = other, one
    if not scale.has_place(one, other):
        return None
    face_ids, border = (
        np.empty(len(of_one) + len(of_other), dtype=np.int32)
        for of_one, of_other in ((one.face_ids, other.face_ids), (one.border, other.border))
    )
    faces, ends = np.empty((len(face_ids), 3), np.int32), np.empty((len(border), 2), np.int32)
    n_most = len(one.points) + len(other.points)
    points, uvs, angles = np.empty((n_most, 3)), np.empty((n_most, 2)), np.empty(n_most)
    counts, figures = np.empty(2, dtype=np.int64), np.empty(4)
    longest = max(scale.chart_length, one.length, other.length)
    is_found = core.stitch_charts(
        *one.arrays, *other.arrays, opposite, weights, np.array([one.measures, other.measures]),
        np.array([scale.excess, scale.waste, longest]), n_iterations,
        face_ids, faces, points, uvs, angles, border, ends, counts, figures,
    )  # fmt: skip
    if not is_found:
        return None
    n_points, n_border = counts.tolist()
    l2, hull, length, share = figures.tolist()
    piece = ChartPiece(
        face_ids=face_ids,
        faces=faces,
        points=points[:n_points],
        uvs=uvs[:n_points],
        angles=angles[:n_points],
        border=border[:n_border],
        border_ends=ends[:n_border],
        area=one.area + other.area,
        l2=l2,
        hull_area=hull,
        length=length,
    )
    return ChartMerge(
        unions=(piece,),
        excess=piece.excess - one.excess - other.excess,
        waste=piece.waste - one.waste - other.waste,
        share=share,
    )
