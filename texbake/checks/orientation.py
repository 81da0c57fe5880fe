"""Checks of which side is outside: winding, shells inside out, and shading normals.

Neighbors that disagree are found edge by edge. A majority decides which of them are flipped: the
faces of a shell are oriented from one to the next, and those of the smaller area count as
flipped. A closed shell of negative volume is inside out, unless it is the wall of a cavity: then it
lies within another shell.
"""

from __future__ import annotations

import numpy as np

from texbake.checks.checked_mesh import CheckedMesh, Finding, Look
from texbake.core import portable_math as pm
from texbake.mapping.seams import connected_faces
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray
from texbake.mesh.normals import NORMAL_ROUNDING, angles_between, shading_normals
from texbake.mesh.remeshing.parts import winding_numbers
from texbake.mesh.topology import against_most, next_half_edges, wind_alike

# Share of the cube of a shell's size up to which its volume is rounding, or the shell is flat.
_LEAST_VOLUME = 1e-12

# Faces examined to distinguish cavities from inside-out shells; beyond that, boxes decide.
_MAX_FACES = 50_000_000


def inconsistent_winding(checked: CheckedMesh) -> Finding | None:
    """Edges that both faces run along in the same direction, and the faces to blame."""
    edges = checked.edges
    one, other, along = _neighbors(checked)
    if not along.any():
        return None
    parts, flips = wind_alike(len(edges.faces), (one // 3, other // 3), ~along)
    turned = against_most(parts, flips, checked.areas[edges.faces])
    # A shell that has no consistent winding, such as a Möbius strip, stays torn somewhere.
    torn = along ^ turned[one // 3] ^ turned[other // 3]
    rows = np.concatenate([np.flatnonzero(turned), one[torn] // 3])
    faces = edges.faces[rows]
    return checked.finding("inconsistent-winding", along.sum(), faces, checked.areas[faces])


def inside_out_shells(checked: CheckedMesh) -> Finding | None:
    """Closed shells with a negative volume that are not the walls of a cavity."""
    shells = _Shells(checked)
    inverted = [shell for shell in shells.negative() if not shells.is_cavity(shell)]
    faces = checked.edges.faces[np.isin(shells.of_rows, inverted)]
    return checked.finding("inside-out-shells", len(inverted), faces, checked.areas[faces])


WINDING_CHECKS = (inconsistent_winding, inside_out_shells)


def _neighbors(checked: CheckedMesh) -> tuple[Int64Array, Int64Array, BoolArray]:
    """Half-edges of each edge of two faces, and whether both run the same way."""
    edges = checked.edges
    one, other = edges.pairs()
    places = checked.places[edges.faces].ravel()
    return one, other, np.asarray(places[one] == places[other])


class _Shells:
    """Shells of a surface, connected by edges, and which of them are closed."""

    def __init__(self, checked: CheckedMesh) -> None:
        edges = checked.edges
        self._positions, self._places = checked.positions, checked.places[edges.faces]
        self._corners = checked.corners[edges.faces]
        self.of_rows = connected_faces(edges.ids)
        self._n = int(self.of_rows.max(initial=-1)) + 1
        _, _, along = _neighbors(checked)
        bad = edges.counts != 2
        bad[edges.counts == 2] |= along
        torn = np.zeros(self._n, dtype=bool)
        torn[self.of_rows[bad[edges.ids].any(axis=1)]] = True
        self._closed = ~torn
        self._faces_left = _MAX_FACES
        self._order = np.argsort(self.of_rows, kind="stable")
        sizes = np.bincount(self.of_rows, minlength=self._n)
        self._starts = np.concatenate([[0], np.cumsum(sizes)])
        # Boxes, and signed volumes, each about the center of its own box.
        self._low, self._high = np.full((self._n, 3), np.inf), np.full((self._n, 3), -np.inf)
        grouped, starts = self._corners[self._order], self._starts[:-1]
        if self._n:
            self._low = np.minimum.reduceat(grouped.min(axis=1), starts, axis=0)
            self._high = np.maximum.reduceat(grouped.max(axis=1), starts, axis=0)
        middles = (self._low + self._high) / 2.0
        a, b, c = np.moveaxis(self._corners - middles[self.of_rows][:, None], 1, 0)
        sixfold = pm.vecdot(a, np.cross(b, c))
        self._volumes = np.bincount(self.of_rows, sixfold, self._n) / 6.0

    def negative(self) -> list[int]:
        """Closed shells with a negative volume."""
        sizes = (self._high - self._low).max(axis=1, initial=0.0)
        inside_out = self._closed & (self._volumes < -_LEAST_VOLUME * sizes**3)
        shells: list[int] = np.flatnonzero(inside_out).tolist()
        return shells

    def is_cavity(self, shell: int) -> bool:
        """Whether a shell lies within others, more of them facing outward than inward."""
        point = self._corners[self._order[self._starts[shell]]].mean(axis=0)
        around = self._closed & (self._low < point).all(axis=1) & (self._high > point).all(axis=1)
        around[shell] = False
        shells = np.flatnonzero(around)
        if len(shells) == 0:
            return False
        starts, stops = self._starts[shells], self._starts[shells + 1]
        self._faces_left -= int((stops - starts).sum())
        if self._faces_left < 0:
            return True
        rows = [self._order[i:j] for i, j in zip(starts, stops, strict=True)]
        places = self._places[np.concatenate(rows)]
        return bool(winding_numbers(self._positions, places, point[None])[0] > 0.5)


def zero_normals(checked: CheckedMesh) -> Finding | None:
    """Faces with an area and a normal of length zero at a corner."""
    mesh = checked.mesh
    if mesh.normals is None:
        return None
    zero = (mesh.normals == 0.0).all(axis=1)
    flagged = zero[mesh.normal_faces].any(axis=1) & checked.has_area
    return checked.flag("zero-normals", flagged, checked.areas)


def turned_normals(checked: CheckedMesh) -> Finding | None:
    """Faces with a normal at a corner that points to their back."""
    mesh = checked.mesh
    if mesh.normals is None or mesh.normal_faces is None:
        return None
    cosines = np.full(mesh.n_faces, np.inf)
    for corner in range(3):
        shading = mesh.normals[mesh.normal_faces[:, corner]]
        np.minimum(cosines, pm.vecdot(shading, checked.normals), out=cosines)
    return checked.flag("turned-normals", cosines < -pm.sin(NORMAL_ROUNDING), -cosines)


def hard_edges_without_seam(checked: CheckedMesh) -> Finding | None:
    """Edges across which normals jump and texture coordinates do not."""
    mesh, edges = checked.mesh, checked.edges
    if mesh.normals is None or mesh.normal_faces is None or not checked.has_coordinates:
        return None
    one, other, along = _neighbors(checked)
    # Corners of the other face at both ends of the edge.
    ends = next_half_edges(one), next_half_edges(other)
    across = np.where(along, other, ends[1]), np.where(along, ends[1], other)
    uv_ids = checked.uv_ids[edges.faces].ravel()
    normal_ids = mesh.normal_faces[edges.faces].ravel()
    joined = (uv_ids[one] == uv_ids[across[0]]) & (uv_ids[ends[0]] == uv_ids[across[1]])
    jumps = np.maximum(
        _angles(mesh.normals, normal_ids[one], normal_ids[across[0]]),
        _angles(mesh.normals, normal_ids[ends[0]], normal_ids[across[1]]),
    )
    hard = joined & (jumps > NORMAL_ROUNDING)
    faces = edges.faces[np.concatenate([one[hard], other[hard]]) // 3]
    return checked.finding("hard-edges-without-seam", hard.sum(), faces, np.tile(jumps[hard], 2))


def other_diagonals(checked: CheckedMesh) -> Finding | None:
    """Polygons that are not flat, and not split from the first corner."""
    mesh = checked.mesh
    if mesh.polygon_of is None:
        return None
    firsts = np.searchsorted(mesh.polygon_of, np.arange(mesh.n_polygons))[mesh.polygon_of]
    elsewhere = (mesh.faces != mesh.faces[firsts, :1]).all(axis=1)
    normals, corners = shading_normals(mesh, threads=checked.options.threads)
    rows = np.column_stack([corners, corners[firsts]])
    turns = [_angles(normals, rows[:, i], rows[:, 3]) for i in range(3)]
    bends = angles_between(checked.normals, checked.normals[firsts])
    curved = np.maximum.reduce([*turns, bends]) > NORMAL_ROUNDING
    cut, bent = (np.bincount(mesh.polygon_of, which) > 0 for which in (elsewhere, curved))
    return checked.flag("other-diagonals", (cut & bent)[mesh.polygon_of])


def _angles(normals: FloatArray, one: IntArray, other: IntArray) -> FloatArray:
    """Angles between normals in radians; 0 where one of them has no direction."""
    angles = np.zeros(len(one))
    differ = np.flatnonzero(one != other)
    angles[differ] = angles_between(normals[one[differ]], normals[other[differ]])
    return angles


NORMAL_CHECKS: tuple[Look, ...] = (
    lambda mesh: mesh.finding("no-normals", int(mesh.mesh.normals is None)),
    zero_normals,
    turned_normals,
)
LOW_POLY_CHECKS = (hard_edges_without_seam, other_diagonals)
