"""A chart as a mesh of its own, while charts are cut and joined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.flattening.flatten import flatten
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray

_ANGLES = 2.0 * np.pi * np.arange(32) / 32.0
_DIRECTIONS = np.stack([pm.cos(_ANGLES), pm.sin(_ANGLES)])
_STEP_COS, _STEP_SIN = _DIRECTIONS[:, 1].tolist()  # from one direction to the next


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartPiece:
    """A connected chart of m faces and n vertices, each with a single fan of faces."""

    face_ids: IntArray  # (m,) int32; faces of the mesh, ascending
    faces: IntArray  # (m, 3) int32; indices into the piece's own vertices
    points: FloatArray  # (n, 3) float64
    # (n, 2) float64; coordinates in the unit of the points, with the area that the piece has in
    # space.
    uvs: FloatArray
    # (n,) float64; sum of the corners' angles in space around each vertex, in radians.
    angles: FloatArray
    border: IntArray  # (k,) int32; half-edges of the mesh on the border of the piece, ascending
    border_ends: IntArray  # (k, 2) int32; vertices where each of them starts and ends
    area: float  # area in space
    l2: float  # L2 stretch of the piece alone; infinite if a face is mirrored
    hull_area: float  # area of the convex hull of the coordinates, or a little more

    @property
    def excess(self) -> float:
        """Area times (L2² - 1), which can be summed over the pieces of a mesh."""
        return self.area * (self.l2**2 - 1.0)

    @property
    def waste(self) -> float:
        """Area of the convex hull that the piece leaves empty."""
        return self.hull_area - self.area

    @property
    def length(self) -> float:
        """Greatest extent of the coordinates, in any direction."""
        extents = _extents(self.uvs)
        return float((extents + np.roll(extents, len(extents) // 2)).max())

    @property
    def border_lengths(self) -> FloatArray:
        """(k,) float64: lengths of the border's half-edges in space."""
        starts, ends = self.border_ends.T
        return np.asarray(pm.norm(self.points[ends] - self.points[starts], axis=1))

    @property
    def is_disk(self) -> bool:
        """Whether it can be flattened: a disk, possibly with holes."""
        starts, ends = self.border_ends.T
        loops = merged_labels(len(self.points), starts, ends)[starts]
        n_loops = len(np.unique(loops))
        n_edges = (3 * len(self.faces) + len(self.border)) // 2
        return n_loops > 0 and len(self.points) - n_edges + len(self.faces) + n_loops == 2


def relax_piece(piece: ChartPiece, *, n_iterations: int) -> ChartPiece | None:
    """Flatten a piece with less distortion, starting from its coordinates if they have no flips.

    Returns None if no layout without flips and overlaps was found.
    """
    for keep_apart in (False, True):
        flat = flatten(
            piece.points,
            piece.faces,
            piece.uvs,
            n_iterations=n_iterations,
            keep_apart=keep_apart,
        )
        if flat is None:
            return None
        if flat.injective:
            return replace(piece, uvs=flat.uvs, l2=flat.l2, hull_area=hull_area(flat.uvs))
    return None


def hull_area(uvs: FloatArray) -> float:
    """Area of the convex hull of points in the plane, at most 0.4 % more for a round one.

    It is the area of the circumscribed polygon of 32 directions. With the extent h(i) in each
    direction, its sides have the lengths (h(i + 1) + h(i - 1) - 2 h(i) cos δ) / sin δ.

    Examples
    --------
    >>> round(hull_area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])), 9)
    2.0
    """
    extents = _extents(uvs)
    sides = np.roll(extents, 1) + np.roll(extents, -1) - 2.0 * extents * _STEP_COS
    return float((extents * sides).sum() / (2.0 * _STEP_SIN))


def _extents(uvs: FloatArray) -> FloatArray:
    """(32,) float64: how far points extend in each direction, from the first of them."""
    return np.asarray((pm.matmul(uvs - uvs[0], _DIRECTIONS)).max(axis=0))
