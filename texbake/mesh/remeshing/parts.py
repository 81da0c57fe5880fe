"""Separate parts of a wrap: solid ones, and the walls of cavities in them, which face inwards.

Winding numbers say what is inside: 1 in a closed surface that faces outwards, 0 outside. Kernel:
`core/winding_numbers.c`.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.compose import used_rows
from texbake.mesh.distance import face_areas
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, Int64Array, IntArray
from texbake.mesh.topology import face_components
from texbake.parallel import run_bands
from texbake.records import dataclass

# In voxels. The surface around a single point of the grid is a voxel across, unless it is moved.
_LEAST_VOLUME, _LEAST_SIZE = 1.0, 1.5
# Sheets have next to no volume, of either sign; the wall of a cavity is about as wide as long.
_LEAST_CAVITY = 3.0
# Parts that were cut off at thin places, or are smaller than a triangle of the low-poly mesh, are
# left out up to this share of the area, together.
_LEFT_OUT = 0.01


@dataclass(frozen=True, eq=False)
class Parts:
    """A closed surface in separate parts."""

    points: FloatArray  # (V, 3) float64; in units of a voxel
    faces: IntArray  # (F, 3) int32
    ids: IntArray  # (F,) int32; part of each face
    volumes: FloatArray  # (n,) float64; in units of a voxel, negative for the walls of cavities

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray) -> Parts:
        """Find the parts."""
        ids, n_parts = face_components(faces, len(points))
        a, b, c = (points[faces[:, corner]] for corner in range(3))
        sixths = pm.vecdot(a, np.cross(b, c))
        return cls(points, faces, ids, np.bincount(ids, sixths, n_parts) / 6.0)

    @property
    def is_wall(self) -> BoolArray:
        """Which of the parts are walls of cavities."""
        return self.volumes < 0.0

    @property
    def areas(self) -> FloatArray:
        """Areas of the parts."""
        areas = face_areas(self.points, self.faces)
        return np.asarray(np.bincount(self.ids, areas, len(self.volumes)), dtype=np.float64)

    def some(self, kept: BoolArray) -> Parts:
        """Return some of the parts, and the points that they use."""
        used, compact = used_rows(self.faces[kept[self.ids]], len(self.points))
        return Parts.of(self.points[used], compact)


def without_crumbs(parts: Parts, *, keep_cavities: bool) -> tuple[Parts, int]:
    """Leave out parts smaller than a voxel but the largest; also count them."""
    sizes = np.zeros(len(parts.volumes))
    if len(sizes) == 1:
        return parts, 0
    for axis in range(3):
        low, high = np.full(len(sizes), np.inf), np.full(len(sizes), -np.inf)
        along = parts.points[:, axis][parts.faces]
        np.minimum.at(low, parts.ids, along.min(axis=1))
        np.maximum.at(high, parts.ids, along.max(axis=1))
        np.maximum(sizes, high - low, out=sizes)
    is_crumb = np.abs(parts.volumes) < _LEAST_VOLUME
    is_crumb &= sizes < np.where(parts.is_wall, _LEAST_CAVITY, _LEAST_SIZE)
    if not keep_cavities:
        is_crumb |= parts.volumes <= -_LEAST_VOLUME
    is_crumb[np.argmax(sizes)] = False
    if not is_crumb.any():
        return parts, 0
    return parts.some(~is_crumb), int(np.count_nonzero(is_crumb & ~parts.is_wall))


def without_cut_off(parts: Parts, n_given: int) -> tuple[Parts, int]:
    """Leave out small solid parts beyond `n_given`, if small together; also count them."""
    solids = np.flatnonzero(~parts.is_wall)
    if len(solids) <= n_given:
        return parts, 0
    areas = parts.areas
    is_more = np.zeros(len(areas), dtype=np.bool_)
    is_more[solids[np.argsort(-areas[solids], kind="stable")[n_given:]]] = True
    return _without_small(parts, areas, is_more)


def without_small_parts(parts: Parts, least: float) -> tuple[Parts, int]:
    """Leave out parts below a share of the area, if small together; also count them."""
    areas = parts.areas
    return _without_small(parts, areas, areas < least * areas.sum())


def _without_small(parts: Parts, areas: FloatArray, is_left_out: BoolArray) -> tuple[Parts, int]:
    n_left_out = int(np.count_nonzero(is_left_out))
    if n_left_out == 0 or areas[is_left_out].sum() > _LEFT_OUT * areas.sum():
        return parts, 0
    return parts.some(~is_left_out), n_left_out


def largest_parts(
    parts: Parts, n_kept: int | None, *, threads: int | None = None
) -> tuple[Parts, int]:
    """Keep the solid parts of most volume, with cavities; also count the others."""
    n_solid = int(np.count_nonzero(~parts.is_wall))
    if n_kept is None or n_solid <= n_kept:
        return parts, 0
    order = np.argsort(-parts.volumes, kind="stable")  # walls come last
    kept = np.zeros(len(order), dtype=np.bool_)
    kept[order[:n_kept]] = True
    walls = np.flatnonzero(parts.is_wall)
    kept[walls] = kept[_owners(parts, walls, order[:n_solid], threads)]
    return parts.some(kept), n_solid - n_kept


def _owners(parts: Parts, walls: IndexArray, solids: IndexArray, threads: int | None) -> IndexArray:
    """The solid part that each wall is in: the smallest around it. Solids are the largest first."""
    points, faces = parts.points, parts.faces
    owners = np.full(len(walls), solids[0])
    if len(walls) == 0:
        return owners
    firsts = np.unique(parts.ids, return_index=True)[1]
    places = points[faces[firsts[walls], 0]]
    for solid in solids[1:]:
        part = faces[parts.ids == solid]
        low, high = points[part].min(axis=(0, 1)), points[part].max(axis=(0, 1))
        near = np.flatnonzero(((places > low) & (places < high)).all(axis=1))
        windings = winding_numbers(points, part, places[near], threads=threads)
        owners[near[windings > 0.5]] = solid
    return owners


# Side of the cells whose faces are one cluster, in voxels.
_CELL = 8.0
_CLUSTERS, _POINTS = 1024, 1

_SAMPLED = 32  # points by which the work is estimated
_FAR = 4.0  # as in `core/winding_numbers.c`
_COST_OF_CLUSTER = 0.2  # as a far cluster, in faces


def winding_numbers(
    positions: FloatArray,
    faces: IntArray,
    points: FloatArray,
    *,
    most_work: float = math.inf,
    threads: int | None = None,
) -> FloatArray:
    """(n,) winding numbers, also of torn surfaces, in voxels; NaN beyond `most_work`."""
    windings = np.zeros(len(points))
    if len(points) == 0 or len(faces) == 0:
        return windings
    key = np.zeros(len(faces), dtype=np.int64)
    for axis in range(3):
        # Of corners alone: vertices of no face may lie anywhere.
        cells = np.floor(positions[faces[:, 0], axis] / _CELL).astype(np.int64)
        cells -= cells.min()
        key = key * (cells.max() + 1) + cells
    order = np.argsort(key, kind="stable")
    starts = np.concatenate([[0], 1 + np.flatnonzero(np.diff(key[order])), [len(faces)]])
    clusters = np.empty((len(starts) - 1, 7))
    surface = (positions, faces[order], starts, clusters)
    gather = partial(core.gather_clusters, *surface)
    measure = partial(core.measure_winding, *surface, points, windings)
    run_bands(gather, len(clusters), band=_CLUSTERS, threads=threads)
    n_measured = int(min(len(points), most_work / _work_of_a_point(clusters, starts, points)))
    run_bands(measure, n_measured, band=_POINTS, threads=threads)
    windings[n_measured:] = np.nan
    return windings


def _work_of_a_point(clusters: FloatArray, starts: Int64Array, points: FloatArray) -> float:
    """Mean number of faces that are added up for a point, from some of them; clusters cost less."""
    some = points[:: -(-len(points) // _SAMPLED)]
    squares = ((clusters[None, :, :3] - some[:, None]) ** 2).sum(axis=2)
    near = squares <= (_FAR * clusters[:, 6]) ** 2
    n_faces = np.where(near, np.diff(starts), _COST_OF_CLUSTER)
    return float(n_faces.sum()) / len(some)
