"""Box mapping: each face is projected onto one of the six sides of a box.

The six pictures lie in the texture as the sides of a die seen from outside, each upright, all at
one scale and with square texels:

    +----+ +----+ +----+
    | +x | | +y | | +z |
    +----+ +----+ +----+
    +----+ +----+ +----+
    | -x | | -y | | -z |
    +----+ +----+ +----+

The nearest side to each normal would leave ragged borders and isolated faces on noise. So the
choice is made from normals averaged over the neighborhood, and small regions are joined to a side
next to them, as long as no face is squashed too much. Sides 0 to 5 are +x, -x, +y, -y, +z and -z.

Based on: Bier, Sloan, "Two-part texture mappings", 1986 (the box, by the object's normal). It
departs in choosing the side by face, not by point, so that no face is torn.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mapping.classical.frames import center_of, in_frame, points_about, upright_frame
from texbake.mapping.corner_uvs import Projected, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.seams import merged_labels
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import edge_ids
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

N_SIDES = 6


DEFAULT_SIDE = 4  # +z, the front

# Least cosine between a face and its side, so that no face is shown at less than a quarter of its
# area. A higher limit leaves more isolated faces. The side nearest to a normal always has a cosine
# of at least 3^-1/2 = 0.58.
_LEAST_COSINE = 0.25

_ROUNDS = 4  # rounds of averaging normals over neighboring faces
_SMALL = 0.01  # share of a connected surface; smaller regions are joined to others

# Relative. Normals this close to halfway between two sides all take the first, so that the rounding
# of float32 positions does not scatter 45-degree chamfers over both.
_TIE = 1e-3


@dataclass(frozen=True, eq=False)
class _Borders:
    """Pairs of faces that share an edge, in both orders, and the length of the edge."""

    faces: IntArray
    neighbors: IntArray
    lengths: FloatArray


def box_sides(mesh: Mesh) -> tuple[IntArray, dict[str, int]]:
    """Choose the side of each face: (F,) int32, and tallies."""
    normals = face_normals(mesh)
    points = LocalFrame.around(mesh).to_local(mesh.positions)
    areas = surface_areas(points[mesh.faces])
    borders = _borders(weld_rows(mesh.positions)[mesh.faces], points[mesh.faces])
    without_normal: BoolArray = (normals == 0.0).all(axis=1)
    allowed = _toward_sides(normals) >= _LEAST_COSINE
    averaged = _averaged(normals, areas, borders)
    own_normals = normals
    if mesh.polygon_of is not None:
        own_normals = _summed(mesh.polygon_of, normals * areas[:, None])
        averaged = _summed(mesh.polygon_of, averaged)
        refusing = ~allowed & ~without_normal[:, None]
        for_all = _summed(mesh.polygon_of, refusing.astype(np.float64)) == 0.0
        allowed = np.where(for_all.any(axis=1, keepdims=True), for_all, allowed)
        without_normal = (own_normals == 0.0).all(axis=1)
    own = _nearest_sides(own_normals, allowed)
    sides = _nearest_sides(averaged, allowed)
    sides[without_normal] = _sides_beside(sides, without_normal, borders)
    allowed[without_normal] = True
    sides = _without_small_regions(sides, allowed, areas, borders)
    joined = (sides != own) & ~without_normal
    return sides, {
        "faces joined to the side of their neighbors": mesh.count_polygons(joined),
        "faces without area": mesh.count_polygons(without_normal),
    }


def _summed(polygons: IntArray, rows: FloatArray) -> FloatArray:
    """Sums of the rows (F, K) of each polygon, for each of its triangles."""
    sums = np.stack([np.bincount(polygons, column) for column in rows.T], axis=1)
    return np.asarray(sums[polygons], np.float64)


def _toward_sides(vectors: FloatArray) -> FloatArray:
    """(F, 6) float64: component of each vector toward each side."""
    return np.stack([vectors, -vectors], axis=2).reshape(-1, N_SIDES)


def _nearest_sides(vectors: FloatArray, allowed: BoolArray) -> IntArray:
    """(F,) int32: the allowed side that each vector points to most."""
    toward = np.where(allowed, _toward_sides(vectors), -np.inf)
    most = toward.max(axis=1, keepdims=True)
    first = (toward >= most - _TIE * np.abs(most)).argmax(axis=1)
    return np.asarray(first, dtype=np.int32)


def _borders(corners: IntArray, points: FloatArray) -> _Borders:
    """Neighboring faces; where more than two meet at an edge, each and the next."""
    keys = edge_ids(corners).ravel()
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    first, second = order[same] // 3, order[same + 1] // 3
    edges = np.roll(points, -1, axis=1) - points
    lengths = np.sqrt(pm.vecdot(edges, edges)).ravel()[order[same]]
    apart = first != second  # a face with one vertex twice borders on itself
    first, second, lengths = first[apart], second[apart], lengths[apart]
    return _Borders(
        np.concatenate([first, second]).astype(np.int32),
        np.concatenate([second, first]).astype(np.int32),
        np.concatenate([lengths, lengths]),
    )


def _averaged(normals: FloatArray, areas: FloatArray, borders: _Borders) -> FloatArray:
    """Normals averaged by area over the neighborhood, but not across sharp edges and folds."""
    faces, neighbors = borders.faces, borders.neighbors
    agree = pm.vecdot(normals[faces], normals[neighbors]) > 0.0
    faces, neighbors = faces[agree], neighbors[agree]
    averaged = normals * areas[:, None]
    for _ in range(_ROUNDS):
        for axis in range(3):
            column = averaged[:, axis]
            averaged[:, axis] += np.bincount(faces, column[neighbors], minlength=len(normals))
    return averaged


def _sides_beside(sides: IntArray, unknown: BoolArray, borders: _Borders) -> IntArray:
    """Sides for faces that have none: each connected group takes the side that it touches most."""
    faces, neighbors = borders.faces, borders.neighbors
    inside = unknown[faces] & unknown[neighbors]
    lots = merged_labels(len(sides), faces[inside], neighbors[inside])
    outline = unknown[faces] & ~unknown[neighbors]
    places = lots[faces[outline]] * N_SIDES + sides[neighbors[outline]]
    n_places = (int(lots.max()) + 1) * N_SIDES
    touches = np.bincount(places, minlength=n_places).reshape(-1, N_SIDES)
    lengths = np.bincount(places, borders.lengths[outline], minlength=n_places)
    longest = np.where(touches > 0, lengths.reshape(-1, N_SIDES), -1.0).argmax(axis=1)
    beside = np.where(touches.any(axis=1), longest, DEFAULT_SIDE)[lots]
    return beside[unknown].astype(np.int32)


def _without_small_regions(
    sides: IntArray, allowed: BoolArray, areas: FloatArray, borders: _Borders
) -> IntArray:
    """Join small regions to the allowed side with the longest common border, all at once."""
    faces, neighbors = borders.faces, borders.neighbors
    shells = merged_labels(len(sides), faces, neighbors)
    least = _SMALL * np.bincount(shells, areas)[shells]
    while True:
        within = sides[faces] == sides[neighbors]
        regions = merged_labels(len(sides), faces[within], neighbors[within])
        n_regions = int(regions.max()) + 1
        region_areas = np.bincount(regions, areas)
        first_faces = np.unique(regions, return_index=True)[1]
        ranks = np.empty(n_regions, dtype=np.int64)
        ranks[np.argsort(region_areas, kind="stable")] = np.arange(1, n_regions + 1)

        places = regions[faces[~within]] * N_SIDES + sides[neighbors[~within]]
        n_places = n_regions * N_SIDES
        shared = np.bincount(places, borders.lengths[~within], minlength=n_places)
        largest = np.zeros(n_places, dtype=np.int64)
        np.maximum.at(largest, places, ranks[regions[neighbors[~within]]])
        fits = (largest > np.repeat(ranks, N_SIDES)).reshape(-1, N_SIDES)
        fits &= (region_areas < least[first_faces])[:, None]
        for side in range(N_SIDES):
            fits[:, side] &= np.bincount(regions, ~allowed[:, side]) == 0
        moving = fits.any(axis=1)
        if not moving.any():
            return sides
        longest = np.where(fits, shared.reshape(-1, N_SIDES), -1.0).argmax(axis=1)
        sides = np.where(moving, longest, sides[first_faces])[regions].astype(np.int32)


def box(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh onto the six sides of a box about its center."""
    sides, tallies = box_sides(mesh)
    local = points_about(mesh, center_of(mesh, options.center), np.eye(3))
    points = local.points[mesh.faces]
    half_size = np.array([np.abs(points[:, :, i]).max() for i in range(3)])
    half_size[half_size <= local.rounding] = 0.0
    return Projected(corners=side_pictures(points, sides, half_size, options), tallies=tallies)


def side_pictures(
    points: FloatArray,
    sides: npt.NDArray[np.integer[Any]],
    half_size: FloatArray,
    options: UnwrapOptions,
) -> FloatArray:
    """(F, 3, 2) coordinates of corners (F, 3, 3) about the center in pictures of sides 0 to 5."""
    if options.overlap:
        size = np.ones(2)
        middles, per_length = np.full((N_SIDES, 2), 0.5), _scale(0.5, half_size.max())
    else:
        size = np.array([options.width_px, options.height_px], dtype=np.float64)
        middles, per_length = _cells(half_size, size, options.padding or 0)
    corners = np.empty((len(points), 3, 2))
    for side, axis in enumerate(np.repeat(np.eye(3), 2, axis=0)):
        at_side = sides == side
        frame = upright_frame(axis if side % 2 == 0 else -axis)
        corners[at_side] = (
            in_frame(points[at_side], frame[:2]) * per_length + middles[side]
        ) / size
    return corners


def _cells(half_size: FloatArray, size: FloatArray, padding: int) -> tuple[FloatArray, float]:
    """(6, 2) centers of the cells, and texels per local unit; all rows are equally high."""
    half_widths = half_size[[2, 0, 0]]
    half_height = half_size[1:].max()
    free = size - np.array([4.0, 3.0]) * padding
    if (free <= 0.0).any():
        raise OptionError(
            f"padding: {padding} texels around six sides leave nothing of "
            f"{size[0]:.0f} x {size[1]:.0f}; use less padding or a larger size"
        )
    per_length = _scale(free, np.array([2.0 * half_widths.sum(), 4.0 * half_height]))
    half_widths, half_height = half_widths * per_length, half_height * per_length
    s = np.cumsum(2.0 * half_widths + padding) - half_widths
    t = padding + half_height + np.array([2.0 * half_height + padding, 0.0])
    return np.stack([np.repeat(s, 2), np.tile(t, 3)], axis=1), per_length


def _scale(free: npt.ArrayLike, needed: npt.ArrayLike) -> float:
    """Largest scale at which all lengths fit into the free space; 1 if all lengths are 0."""
    with np.errstate(divide="ignore"):
        scale = float(np.min(np.asarray(free) / needed))
    return scale if math.isfinite(scale) else 1.0
