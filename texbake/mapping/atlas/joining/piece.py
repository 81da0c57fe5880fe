"""A chart by itself, with vertices of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from texbake.mapping.atlas.flattening.flatten import flatten
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray

_ANGLES = 2.0 * np.pi * np.arange(32) / 32.0
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """A connected chart of m faces and n vertices, each with a single fan of faces.

    Attributes
    ----------
    face_ids : (m,) int32
        Of the mesh, ascending.
    faces : (m, 3) int32
        Indices of the piece's own vertices.
    points : (n, 3) float64
    uvs : (n, 2) float64
        In the unit of the points; the piece has the area that it has in space.
    angles : (n,) float64
        Sum of the corners' angles in space around each vertex, in radians.
    border : (k,) int32
        Half-edges of the mesh along which the piece ends, ascending.
    border_ends : (k, 2) int32
        Vertices where each of them starts and ends.
    area : float
        In space.
    l2 : float
        Stretch of the piece by itself; infinite where a face is mirrored.
    hull_area : float
        Of the convex hull of the coordinates, or a little more.
    """

    face_ids: IntArray
    faces: IntArray
    points: FloatArray
    uvs: FloatArray
    angles: FloatArray
    border: IntArray
    border_ends: IntArray
    area: float
    l2: float
    hull_area: float

    @property
    def excess(self) -> float:
        """Area times what the square of the stretch is above 1: sums of it tell a mesh's."""
        return self.area * (self.l2**2 - 1.0)

    @property
    def waste(self) -> float:
        """Area within the convex hull that the piece does not cover."""
        return self.hull_area - self.area

    @property
    def border_lengths(self) -> FloatArray:
        """(k,) float64: lengths in space of the half-edges of the border."""
        starts, ends = self.border_ends.T
        return np.asarray(np.linalg.norm(self.points[ends] - self.points[starts], axis=1))

    @property
    def is_disk(self) -> bool:
        """Whether the plane could hold it: a disk, maybe with holes."""
        starts, ends = self.border_ends.T
        loops = merged_labels(len(self.points), starts, ends)[starts]
        n_loops = len(np.unique(loops))
        n_edges = (3 * len(self.faces) + len(self.border)) // 2
        return n_loops > 0 and len(self.points) - n_edges + len(self.faces) + n_loops == 2


def relaxed_piece(piece: Piece, *, n_iterations: int) -> Piece | None:
    """Lay a piece out with less distortion, starting from its coordinates if these have no flips.

    Returns
    -------
    Piece or None
        None where no layout was found that has neither flips nor overlaps.
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

    It is that of the polygon of 32 directions that just holds them: with the reach h(i) in each
    direction, its sides are (h(i + 1) + h(i - 1) - 2 h(i) cos δ) / sin δ long.

    Examples
    --------
    >>> round(hull_area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])), 9)
    2.0
    """
    reach = ((uvs - uvs[0]) @ _DIRECTIONS).max(axis=0)
    step = 2.0 * math.pi / len(reach)
    sides = np.roll(reach, 1) + np.roll(reach, -1) - 2.0 * reach * math.cos(step)
    return float((reach * sides).sum() / (2.0 * math.sin(step)))
