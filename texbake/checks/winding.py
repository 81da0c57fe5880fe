"""Which side of a surface is outside: faces against their neighbors, shells inside out.

Neighbors that disagree are found edge by edge. Which of them are turned over is decided by
majority: the faces of a part are oriented from one to the next, and those of the lesser area count
as turned. A closed shell of negative volume is inside out, unless it is the wall of a hollow: then
it lies within another shell.

Based on: A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", 1983 (whether a point
lies within a shell); R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.finding import Finding, found
from texbake.checks.subject import (
    BoolArray,
    Edges,
    Ids,
    Subject,
)
from texbake.kernels import kernel
from texbake.mapping.seams import connected_faces
from texbake.mesh.mesh import FloatArray

# Share of the cube of a shell's size below which its volume is rounding, or it is flat.
_LEAST_VOLUME = 1e-12
# Faces looked at to tell hollows from shells inside out; beyond them a box around will do.
_MOST_FACES = 50_000_000


def inconsistent_winding(subject: Subject) -> Finding | None:
    """Find edges whose two faces walk them in the same direction, and the faces to blame."""
    edges = subject.edges
    one, other, along = _neighbors(subject)
    if not along.any():
        return None
    turned = _minority(subject, one // 3, other // 3, along)
    # A part that has no consistent winding, as a Möbius strip, stays torn somewhere.
    torn = along ^ turned[one // 3] ^ turned[other // 3]
    rows = np.concatenate([np.flatnonzero(turned), one[torn] // 3])
    faces = edges.faces[rows]
    return found("inconsistent-winding", subject.role, along.sum(), faces, subject.areas[faces])


def inside_out_shells(subject: Subject) -> Finding | None:
    """Find closed shells that enclose a negative volume and are no walls of a hollow."""
    shells = _Shells(subject)
    faces = subject.edges.faces
    inverted = [shell for shell in shells.negative() if not shells.is_hollow(shell)]
    rows = np.flatnonzero(np.isin(shells.of_rows, inverted))
    return found(
        "inside-out-shells", subject.role, len(inverted), faces[rows], subject.areas[faces[rows]]
    )


CHECKS = (inconsistent_winding, inside_out_shells)


def _neighbors(subject: Subject) -> tuple[Ids, Ids, BoolArray]:
    """Half-edges of each edge of two faces, and whether both walk it the same way."""
    edges = subject.edges
    one, other = edges.pairs()
    places = subject.places[edges.faces].ravel()
    return one, other, np.asarray(places[one] == places[other])


def _minority(subject: Subject, one: Ids, other: Ids, along: BoolArray) -> BoolArray:
    """(n,) bool: of the faces looked at, those wound against most of their part's area."""
    rows = subject.edges.faces
    roots, flips = _oriented(len(rows), one, other, along)
    areas = subject.areas[rows]
    flipped = np.bincount(roots, areas * flips, len(rows))
    upright = np.bincount(roots, areas * ~flips, len(rows))
    # Of equal areas those that the first face is among are right.
    return np.asarray(flips ^ (flipped > upright)[roots])


def _oriented(n: int, one: Ids, other: Ids, along: BoolArray) -> tuple[Ids, BoolArray]:
    """Part of each face, and whether it is wound against the part's first face."""
    parents, flips = np.arange(n), np.zeros(n, dtype=np.bool_)
    _orient_kernel(parents, flips, one, other, along)
    return parents, flips


class _Shells:
    """The parts of a surface that hang together by edges, and which of them are closed."""

    def __init__(self, subject: Subject) -> None:
        edges: Edges = subject.edges
        self._corners = subject.corners[edges.faces]
        self.of_rows = connected_faces(edges.ids)
        self._n = int(self.of_rows.max(initial=-1)) + 1
        _, _, along = _neighbors(subject)
        bad = edges.counts != 2
        bad[edges.counts == 2] |= along
        torn = np.zeros(self._n, dtype=bool)
        torn[self.of_rows[bad[edges.ids].any(axis=1)]] = True
        self._closed = ~torn
        self._faces_left = _MOST_FACES
        self._order = np.argsort(self.of_rows, kind="stable")
        sizes = np.bincount(self.of_rows, minlength=self._n)
        self._starts = np.concatenate([[0], np.cumsum(sizes)])
        self._measure()

    def _measure(self) -> None:
        """Compute boxes and signed volumes, each about the middle of its shell's own box."""
        self._low, self._high = np.full((self._n, 3), np.inf), np.full((self._n, 3), -np.inf)
        grouped, starts = self._corners[self._order], self._starts[:-1]
        if self._n:
            self._low = np.minimum.reduceat(grouped.min(axis=1), starts, axis=0)
            self._high = np.maximum.reduceat(grouped.max(axis=1), starts, axis=0)
        middles = (self._low + self._high) / 2.0
        a, b, c = np.moveaxis(self._corners - middles[self.of_rows][:, None], 1, 0)
        sixfold = np.einsum("ij,ij->i", a, np.cross(b, c))
        self._volumes = np.bincount(self.of_rows, sixfold, self._n) / 6.0

    def negative(self) -> list[int]:
        """Closed shells of negative volume."""
        sizes = (self._high - self._low).max(axis=1, initial=0.0)
        inside_out = self._closed & (self._volumes < -_LEAST_VOLUME * sizes**3)
        shells: list[int] = np.flatnonzero(inside_out).tolist()
        return shells

    def is_hollow(self, shell: int) -> bool:
        """Whether a shell lies within others, more of them outside out than inside out."""
        point = self._corners[self._order[self._starts[shell]]].mean(axis=0)
        around = self._closed & (self._low < point).all(axis=1) & (self._high > point).all(axis=1)
        around[shell] = False
        candidates = np.flatnonzero(around)
        turns = 0.0
        for other in candidates.tolist():
            rows = self._order[self._starts[other] : self._starts[other + 1]]
            self._faces_left -= len(rows)
            if self._faces_left < 0:
                return True
            turns += _solid_angle(self._corners[rows], point) / (4.0 * math.pi)
        return turns > 0.5


def _solid_angle(corners: FloatArray, point: npt.NDArray[Any]) -> float:
    """Sum of the signed solid angles of triangles seen from a point, 4 π for a shell around it."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(edge, axis=1) for edge in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc
    for x, y, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        below += np.einsum("ij,ij->i", x, y) * length
    return float(2.0 * np.arctan2(above, below).sum())


@kernel
def _orient_kernel(parents, flips, one, other, along):  # type: ignore[no-untyped-def]
    """Join neighbors, each with whether it is wound against its parent; the least is the root."""
    for i in range(len(one)):
        a, b = one[i], other[i]
        differ = along[i]
        while parents[a] != a:
            differ ^= flips[a]
            a = parents[a]
        while parents[b] != b:
            differ ^= flips[b]
            b = parents[b]
        if a < b:
            parents[b], flips[b] = a, differ
        elif b < a:
            parents[a], flips[a] = b, differ
        # Let both lead to the root at once, so that no chain grows long.
        root = min(a, b)
        for start in (one[i], other[i]):
            face, against = start, False
            while parents[face] != face:
                against ^= flips[face]
                face = parents[face]
            face = start
            while parents[face] != root and parents[face] != face:
                up, step = parents[face], flips[face]
                parents[face], flips[face] = root, against
                against ^= step
                face = up
    for face in range(len(parents)):
        # Parents are lower than their children, and so already lead to the root.
        up = parents[face]
        if parents[up] != up:
            flips[face] ^= flips[up]
            parents[face] = parents[up]
