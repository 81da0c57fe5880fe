"""Which of the six sides of a box each face of a mesh belongs to.

The obvious choice is the side nearest to the face's normal. On noise, and on surfaces halfway
between two sides, that leaves ragged borders and isolated faces. So the choice is made from normals
averaged over the neighborhood, and small regions are joined to a side next to them, as long as no
face is squashed too much. The triangles of a polygon have one side, if there is one for all.

Sides are numbered: 0 and 1 for +x and -x, 2 and 3 for +y and -y, 4 and 5 for +z and -z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import edge_ids
from texbake.mesh.weld import weld_rows

N_SIDES = 6

BoolArray = npt.NDArray[np.bool_]

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


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxSides:
    """Sides of faces."""

    sides: IntArray  # (F,) int32
    n_joined: int  # faces whose side is not the one nearest to their own normal
    # Faces without area; they take the side that most of their outline touches, or +z.
    n_without_normal: int


@dataclass(frozen=True, eq=False)
class _Borders:
    """Pairs of faces that share an edge, in both orders, and the length of the edge."""

    faces: IntArray
    neighbors: IntArray
    lengths: FloatArray


def box_sides(mesh: Mesh) -> BoxSides:
    """Choose the side of each face."""
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
    return BoxSides(
        sides=sides,
        n_joined=mesh.count_polygons((sides != own) & ~without_normal),
        n_without_normal=mesh.count_polygons(without_normal),
    )


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
    """Join small regions to a neighboring side that is allowed for all their faces.

    Of the sides of larger regions next to it, a region joins the one with the longest common
    border. All regions move at once. The largest that moves joins one that stays, so that each
    round leaves fewer regions.
    """
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
