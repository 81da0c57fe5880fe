"""Spread-out charts cut into compact ones, from which better shapes can be joined.

A chart that leaves much of its convex hull empty is cut along the straight line, of a few, whose
parts leave least, again and again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mapping.atlas.joining.piece import Piece
from texbake.mapping.atlas.joining.pieces import parts_of
from texbake.mesh.mesh import IntArray

_DIRECTIONS = 4
_PLACES = (0.25, 0.5, 0.75)  # shares of the faces on one side of a line

# A cut must save this share of the area of the chart, or it only makes seams.
_LEAST_SAVED = 0.05


def compact_parts(
    piece: Piece, opposite: IntArray, *, most_waste: float, least_area: float
) -> list[Piece]:
    """Cut a piece until its parts leave little of their convex hulls empty.

    Parameters
    ----------
    piece : Piece
    opposite : (3 F,) int32
        From `opposite_half_edges`.
    most_waste : float
        As a share of the area of a part. Parts may waste more where no line is of use.
    least_area : float
        Parts smaller than this are not cut.

    Returns
    -------
    list of Piece
        Their coordinates are those of the piece.
    """
    parts, left = [], [piece]
    while left:
        piece = left.pop()
        best: list[Piece] = []
        if piece.waste > most_waste * piece.area and piece.area > least_area:
            least = piece.waste - _LEAST_SAVED * piece.area
            for sides in _lines(piece):
                halves = parts_of(piece, sides, opposite)
                waste = sum(half.waste for half in halves)
                if waste < least:
                    best, least = halves, waste
        if best:
            left += best
        else:
            parts.append(piece)
    return parts


def _lines(piece: Piece) -> list[npt.NDArray[np.bool_]]:
    """Sides (m,) of the faces of a piece for lines in some directions and places."""
    centers = piece.uvs[piece.faces].mean(axis=1)
    angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    lines = []
    for direction in np.stack([np.cos(angles), np.sin(angles)], axis=1):
        along = centers @ direction
        for place in np.quantile(along, _PLACES):
            sides = along < place
            if sides.any():
                lines.append(sides)
    return lines
