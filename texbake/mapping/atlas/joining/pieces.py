"""Charts as meshes of their own, taken from a mesh, cut into parts, and put back together.

Two corners are one vertex of a piece if they are connected through faces that the chart keeps
together, so that a chart may touch itself, at a vertex or along a cut, without being stitched
there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.flatten import measure_layout
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.topology import next_half_edges
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

LongArray = npt.NDArray[np.int64]

_MOST_LINF = 5.0  # of a face in a joined or straightened piece


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
    length: float  # greatest extent of the coordinates, in any direction

    @property
    def excess(self) -> float:
        """Area times (L2² - 1), which can be summed over the pieces of a mesh."""
        return self.area * (self.l2 * self.l2 - 1.0)

    @property
    def waste(self) -> float:
        """Area of the convex hull that the piece leaves empty."""
        return self.hull_area - self.area

    @cached_property
    def linf(self) -> float:
        """L∞ stretch of the piece alone. Kernel: `core/flatten.c`."""
        return float(core.greatest_stretch(self.points, self.faces, self.uvs))

    def is_crushed(self, before: Sequence[ChartPiece]) -> bool:
        """Whether a face stretches too much, and more than any face of the pieces before."""
        return self.linf > _MOST_LINF and self.linf > max(piece.linf for piece in before)

    @cached_property
    def measures(self) -> tuple[float, float, float, float]:
        """Area, L2 stretch, hull area, and length of the border in space."""
        starts, ends = self.border_ends.T
        lengths = pm.norm(self.points[ends] - self.points[starts], axis=1)
        return self.area, self.l2, self.hull_area, float(lengths.sum())

    @property
    def arrays(self) -> tuple[npt.NDArray[np.generic], ...]:
        """The arrays, in their order."""
        return (
            self.face_ids, self.faces, self.points, self.uvs, self.angles, self.border,
            self.border_ends,
        )  # fmt: skip


def relax_piece(piece: ChartPiece, *, n_iterations: int) -> ChartPiece | None:
    """Flatten a piece with less distortion, None if it fails, by `core/chart_stitching.c`."""
    uvs, figures = np.empty_like(piece.uvs), np.empty(3)
    if not core.relax_chart(piece.points, piece.faces, piece.uvs, n_iterations, uvs, figures):
        return None
    l2, hull, length = figures.tolist()
    return replace(piece, uvs=uvs, l2=l2, hull_area=hull, length=length)


def hull_area(uvs: FloatArray) -> float:
    """Area of the convex hull of points in the plane, at most 0.4 % more for a round one.

    It is the area of the circumscribed polygon of 32 directions. With the extent h(i) in each
    direction, its sides have the lengths (h(i + 1) + h(i - 1) - 2 h(i) cos δ) / sin δ.

    >>> round(hull_area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])), 9)
    2.0
    """
    return _hull(uvs)[0]


def _hull(uvs: FloatArray) -> tuple[float, float]:
    """Area of the convex hull, and the greatest extent. Kernel: `core/chart_stitching.c`."""
    figures = np.empty(2)
    core.measure_hull_of(np.ascontiguousarray(uvs), figures)
    area, length = figures.tolist()
    return area, length


_N_DIRECTIONS = 4
_PLACES = (0.25, 0.5, 0.75)  # shares of the faces on one side of the line

# A cut must save this share of the chart's area, or it only adds seams.
_LEAST_SAVED = 0.05


def pieces_of(surface: ChartSurface, charts: Charts, opposite: IntArray) -> list[ChartPiece]:
    """Turn charts into pieces, one for each connected part, in the order of their first faces."""
    points, mesh_faces = surface.points, surface.faces
    corners = mesh_faces.ravel(), charts.faces.ravel()
    rows = (points[corners[0]], charts.uvs[corners[1]], charts.chart_ids[corners[1]][:, None])
    same = weld_rows(np.concatenate(rows, axis=1))
    half_edges = np.flatnonzero(opposite >= 0).astype(np.int32)
    across = opposite[half_edges]
    glued = (same[half_edges] == same[next_half_edges(across)]) & (
        same[next_half_edges(half_edges)] == same[across]
    )
    face_ids = np.flatnonzero(charts.solid).astype(np.int32)
    return connected_pieces(
        face_ids,
        points[mesh_faces[face_ids]],
        charts.uvs[charts.faces[face_ids]],
        within(face_ids, half_edges[glued]),
        within(face_ids, across[glued]),
    )


def parts_of(
    piece: ChartPiece, sides: npt.NDArray[np.bool_], opposite: IntArray
) -> list[ChartPiece]:
    """Cut a piece between faces of different `sides` (m,); coordinates do not change."""
    local, across = _inner_half_edges(piece, opposite)
    kept = sides[local // 3] == sides[across // 3]
    return connected_pieces(
        piece.face_ids, piece.points[piece.faces], piece.uvs[piece.faces], local[kept], across[kept]
    )


def _inner_half_edges(piece: ChartPiece, opposite: IntArray) -> tuple[IntArray, IntArray]:
    """Half-edges between faces of a piece, and their opposites, numbered within the piece."""
    is_inner = np.ones(3 * len(piece.face_ids), dtype=bool)
    is_inner[within(piece.face_ids, piece.border)] = False
    across = opposite[(3 * piece.face_ids[:, None] + np.arange(3, dtype=np.int32)).ravel()]
    local = np.flatnonzero(is_inner & (across >= 0)).astype(np.int32)
    return local, within(piece.face_ids, across[local])


def charts_of(pieces: Sequence[ChartPiece], charts: Charts) -> Charts:
    """Turn pieces back into charts, each with its area in space and about its own origin."""
    pieces = sorted(pieces, key=lambda piece: int(piece.face_ids[0]))
    sizes = np.array([len(piece.points) for piece in pieces])
    solid = charts.solid
    owned = np.concatenate([piece.face_ids for piece in pieces])
    assert np.array_equal(np.bincount(owned, minlength=len(solid)), solid), "one piece for each"
    faces = np.zeros_like(charts.faces)
    for piece, first in zip(pieces, np.cumsum(sizes) - sizes, strict=True):
        faces[piece.face_ids] = piece.faces + first
    # A face without a chart stays at its vertex.
    now = np.zeros(len(charts.uvs), dtype=np.int32)
    now[charts.faces[solid][::-1].ravel()] = faces[solid][::-1].ravel()
    faces[~solid] = now[charts.faces[~solid]]
    return replace(
        charts,
        uvs=np.concatenate([_settled(piece) for piece in pieces]),
        faces=faces,
        chart_ids=np.repeat(np.arange(len(pieces), dtype=np.int32), sizes),
    )


def within(face_ids: IntArray, half_edges: IntArray) -> IntArray:
    """Half-edges of the mesh, renumbered among its faces `face_ids`, which contain them all."""
    places = 3 * np.searchsorted(face_ids, half_edges // 3) + half_edges % 3
    return np.asarray(places, dtype=np.int32)


def connected_pieces(
    face_ids: IntArray,
    corners: FloatArray,
    corner_uvs: FloatArray,
    half_edges: IntArray,
    across: IntArray,
) -> list[ChartPiece]:
    """Make a piece of each connected part of faces (m,), by corners (m, 3) and edges (k,)."""
    vertices = merged_labels(
        3 * len(face_ids),
        np.concatenate([half_edges, next_half_edges(half_edges)]),
        np.concatenate([next_half_edges(across), across]),
    ).reshape(-1, 3)
    is_border = np.ones((len(face_ids), 3), dtype=bool)
    is_border.ravel()[half_edges] = False
    areas, angles = surface_areas(corners), _corner_angles(corners)
    return [
        _piece(
            face_ids[own], corners[own], corner_uvs[own], vertices[own], is_border[own],
            float(areas[own].sum()), angles[own],
        )
        for own in _connected_faces(len(face_ids), half_edges, across)
    ]  # fmt: skip


def _connected_faces(n_faces: int, half_edges: IntArray, across: IntArray) -> list[LongArray]:
    """Faces of each connected part, ascending."""
    parts = merged_labels(n_faces, half_edges // 3, across // 3)
    return np.split(np.argsort(parts, kind="stable"), np.cumsum(np.bincount(parts))[:-1])


def _piece(
    face_ids: IntArray,
    corners: FloatArray,
    corner_uvs: FloatArray,
    vertices: IntArray,
    is_border: npt.NDArray[np.bool_],
    area: float,
    angles: FloatArray,
) -> ChartPiece:
    """Renumber the vertices of one piece, and measure it."""
    _, first, flat = np.unique(vertices, return_index=True, return_inverse=True)
    faces: IntArray = flat.reshape(-1, 3).astype(np.int32)
    points, uvs = corners.reshape(-1, 3)[first], corner_uvs.reshape(-1, 2)[first]
    rows, columns = np.nonzero(is_border)
    layout = measure_layout(points, faces, uvs)
    hull, length = _hull(uvs)
    return ChartPiece(
        face_ids=face_ids,
        faces=faces,
        points=points,
        uvs=uvs,
        angles=np.asarray(np.bincount(faces.ravel(), angles.ravel()), dtype=np.float64),
        border=(3 * face_ids[rows] + columns).astype(np.int32),
        border_ends=np.stack([faces[rows, columns], faces[rows, (columns + 1) % 3]], axis=1),
        area=area,
        l2=np.inf if layout is None else layout.l2,
        hull_area=hull,
        length=length,
    )


def _corner_angles(corners: FloatArray) -> FloatArray:
    """(m, 3) float64: angle in space at each corner; 0 if an edge has no length."""
    forward = np.roll(corners, -1, axis=1) - corners
    backward = np.roll(corners, 1, axis=1) - corners
    sines = pm.norm(np.cross(forward, backward), axis=2)
    return np.asarray(pm.arctan2(sines, (forward * backward).sum(axis=2)))


def _settled(piece: ChartPiece) -> FloatArray:
    """Coordinates of a piece about their mean, scaled to its area in space."""
    flat = float(signed_areas(piece.uvs[piece.faces]).sum())
    scale = np.sqrt(piece.area / flat) if flat > 0.0 else 1.0
    return np.asarray((piece.uvs - piece.uvs.mean(axis=0)) * scale)


def whole_polygons(
    piece: ChartPiece, sides: npt.NDArray[np.bool_], polygons: IntArray | None
) -> npt.NDArray[np.bool_]:
    """(m,) `sides` of the faces of a piece, with each polygon on the side of its first face."""
    if polygons is None:
        return sides
    _, firsts, numbers = np.unique(polygons[piece.face_ids], return_index=True, return_inverse=True)
    return np.asarray(sides[firsts[numbers]])


def compact_parts(
    piece: ChartPiece,
    opposite: IntArray,
    polygons: IntArray | None,
    *,
    most_waste: float,
    least_area: float,
) -> list[ChartPiece]:
    """Cut a piece by straight lines until parts waste at most a share of their convex hulls."""
    parts, left = [], [piece]
    while left:
        piece = left.pop()
        best: list[ChartPiece] = []
        if piece.waste > most_waste * piece.area and piece.area > least_area:
            sides = _best_line(piece, opposite, polygons)
            best = [] if sides is None else parts_of(piece, sides, opposite)
        if best:
            left += best
        else:
            parts.append(piece)
    return parts


def _best_line(
    piece: ChartPiece, opposite: IntArray, polygons: IntArray | None
) -> npt.NDArray[np.bool_] | None:
    """(m,) sides of the line that leaves the least waste; None if each leaves too much."""
    best, least = None, piece.waste - _LEAST_SAVED * piece.area
    local, across = _inner_half_edges(piece, opposite)
    uvs, areas = piece.uvs[piece.faces], surface_areas(piece.points[piece.faces])
    for sides in _lines(piece):
        whole = whole_polygons(piece, sides, polygons)
        if whole.all() or not whole.any():
            continue
        kept = whole[local // 3] == whole[across // 3]
        waste = sum(
            hull_area(uvs[own].reshape(-1, 2)) - float(areas[own].sum())
            for own in _connected_faces(len(whole), local[kept], across[kept])
        )
        if waste < least:
            best, least = whole, waste
    return best


def _lines(piece: ChartPiece) -> list[npt.NDArray[np.bool_]]:
    """Ways to divide the faces of a piece by a line, as (m,) sides."""
    centers = piece.uvs[piece.faces].mean(axis=1)
    angles = np.pi * np.arange(_N_DIRECTIONS) / _N_DIRECTIONS
    lines = []
    for direction in np.stack([pm.cos(angles), pm.sin(angles)], axis=1):
        along = pm.matmul(centers, direction)
        for place in np.quantile(along, _PLACES):
            sides = along < place
            if sides.any():
                lines.append(sides)
    return lines
