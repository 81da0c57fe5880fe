"""A mesh flattened in pieces: what is cut, mended, relaxed, joined and packed."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.mesh.mesh import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """A mesh flattened in pieces, each laid out for itself about its own origin.

    Attributes
    ----------
    uvs : (T, 2) float64
        Coordinates, in the unit of the points: a chart has the area that its faces have in space.
    faces : (F, 3) int32
        Indices into `uvs`; the three are equal in a face that lies in no chart.
    chart_ids : (T,) int32
        Chart of each coordinate; charts are numbered from 0 without gaps.
    n_ignored : int
        Faces that lie in no chart, because they have no area on the grid, or next to none.
    n_mirrored : int
        Charts that came out mirrored and were turned over.
    n_split : int
        Charts that were made by taking apart those that lay on themselves.
    notes : tuple of str
        What a report should say: steps that failed and what was done instead, charts that miss a
        bound and why.
    """

    uvs: FloatArray
    faces: IntArray
    chart_ids: IntArray
    n_ignored: int
    n_mirrored: int
    n_split: int
    notes: tuple[str, ...] = ()

    @property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart_ids.max()) + 1
