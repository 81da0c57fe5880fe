"""Which charts share seams, and which are mirror images of each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.cut import snap_points
from texbake.mapping.atlas.mirrored_charts import find_counterparts
from texbake.mapping.atlas.source import ChartSource
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.topology import next_half_edges, opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

_QUARTER = math.pi / 2.0
_MOST_SEAMS = 8  # edges that stand for all edges between two charts
_TURN_AWAY = math.radians(5.0)  # most that charts along u and v differ from mirror images


@dataclass(frozen=True, kw_only=True, eq=False)
class Neighbors:
    """Which charts share seams, and which are mirror images of each other."""

    # (S, 2, 2) int32; coordinates at both ends of each seam, on both of its sides.
    seams: IntArray
    weights: FloatArray  # (S,) float64; length of each in space
    partners: IntArray  # (C,) int32; the mirror image of each chart, -1 for none
    # (C,) float64; sum of the angles, in radians, at which a chart and its mirror image are
    # mirror images of each other along u or v.
    mirrors: FloatArray

    def without_pairs(self) -> Neighbors:
        """These neighbors, none of which is a mirror image."""
        return replace(self, partners=np.full_like(self.partners, -1))

    def mirrored(self, angles: FloatArray, aligned: BoolArray) -> tuple[Neighbors, FloatArray]:
        """These neighbors, and angles (C,) at which pairs mirror each other.

        Aligned charts only turn by quarters, and are no longer pairs where that is not enough.
        """
        ids, partners = np.arange(len(angles)), self.partners
        second = (partners >= 0) & (ids > partners)
        wanted = self.mirrors - angles[partners]
        turns = np.rint((wanted - angles) / _QUARTER) * _QUARTER
        found = np.where(second, np.where(aligned, angles + turns, wanted), angles)
        away = second & (np.abs(wanted - found) > _TURN_AWAY)
        away |= (partners >= 0) & (aligned != aligned[partners])
        lost = away | (away[partners] & (partners >= 0))
        pairs = replace(self, partners=np.where(lost, np.int32(-1), partners))
        return pairs, np.where(lost, angles, found)


def find_neighbors(
    meshes: Sequence[Mesh],
    all_charts: Sequence[Charts],
    sources: Sequence[ChartSource],
    *,
    pairs: bool,
) -> Neighbors:
    """Find neighbors and, if `pairs`, mirror images among charts that are packed together.

    With `fast`, the mirror images of charts differ by a few faces; with `best`, layouts of pairs
    fill less. `sources`: those of the charts, none of which are mirror images if it is empty.
    """
    found = [
        _neighbors_of(mesh, charts, source, pairs)
        for mesh, charts, source in itertools.zip_longest(meshes, all_charts, sources)
    ]
    n_uvs = np.cumsum([0, *(len(charts.uvs) for charts in all_charts)])
    n_charts = np.cumsum([0, *(charts.n_charts for charts in all_charts)])
    return Neighbors(
        seams=np.concatenate([each.seams + n for each, n in zip(found, n_uvs, strict=False)]),
        weights=np.concatenate([each.weights for each in found]),
        partners=np.concatenate(
            [
                np.where(each.partners >= 0, each.partners + n, -1).astype(np.int32)
                for each, n in zip(found, n_charts, strict=False)
            ]
        ),
        mirrors=np.concatenate([each.mirrors for each in found]),
    )


def _neighbors_of(mesh: Mesh, charts: Charts, source: ChartSource | None, pairs: bool) -> Neighbors:
    points = snap_points(mesh) if source is None else source.surface.points
    corners = weld_rows(points)[mesh.faces] if source is None else source.surface.corners
    solid = charts.solid & (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    if charts.stacked is not None:
        solid &= ~charts.stacked
    owners = charts.chart_ids[charts.faces[:, 0]]
    opposite = opposite_half_edges(corners, solid=solid)
    edges = np.flatnonzero(opposite > np.arange(len(opposite)))
    edges = edges[owners[edges // 3] != owners[opposite[edges] // 3]]
    across = opposite[edges]
    uvs = charts.faces.ravel()
    ends = [(uvs[edges], uvs[next_half_edges(edges)]), (uvs[next_half_edges(across)], uvs[across])]
    seams = np.moveaxis(np.array(ends), -1, 0)
    tails, heads = (corners.ravel()[each] for each in (edges, next_half_edges(edges)))
    lengths = pm.norm(points[heads] - points[tails], axis=1)
    kept, weights = _some_of_each(np.sort(owners[np.stack([edges, across]) // 3], axis=0), lengths)
    partners, mirrors = np.full(charts.n_charts, -1, dtype=np.int32), np.zeros(charts.n_charts)
    if pairs and source and charts.stacked is None and source.halves:
        halves = source.halves
        ids = np.flatnonzero(charts.solid).astype(np.int32)
        ids = ids[np.argsort(owners[ids], kind="stable")]
        faces = np.split(ids, np.searchsorted(owners[ids], np.arange(1, charts.n_charts)))
        for one, other in find_counterparts(faces, source.surface, halves).items():
            if one != other:
                partners[one] = other
        mirrors = _mirror_angles(points[mesh.faces], charts, solid, partners, halves.plane.normal)
    return Neighbors(seams=seams[kept], weights=weights, partners=partners, mirrors=mirrors)


def _some_of_each(pairs: IntArray, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
    """Edges, spread evenly, that stand for all between the same two charts, and their weights."""
    order = np.lexsort((*pairs,))
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (pairs[:, order[1:]] != pairs[:, order[:-1]]).any(axis=0)
    starts = np.flatnonzero(is_first)
    groups = np.cumsum(is_first) - 1
    counts = np.bincount(groups)
    ranks = np.arange(len(order)) - starts[groups]
    numbers = ranks * _MOST_SEAMS // np.maximum(counts, 1)[groups]
    is_kept = is_first | (np.diff(numbers, prepend=-1) != 0)
    sums = np.bincount(groups, lengths[order]) / np.maximum(np.bincount(groups, is_kept), 1.0)
    return order[is_kept], sums[groups[is_kept]]


def _mirror_angles(
    corners: FloatArray, charts: Charts, solid: BoolArray, partners: IntArray, normal: FloatArray
) -> FloatArray:
    """(C,) `mirrors` of pairs, from the mean directions of u and v in space."""
    owners = charts.chart_ids[charts.faces[solid, 0]]
    first, second = (corners[solid, i] - corners[solid, 0] for i in (1, 2))
    uvs = charts.uvs[charts.faces[solid]]
    (x1, y1), (x2, y2) = ((uvs[:, i] - uvs[:, 0]).T[..., None] for i in (1, 2))
    along, up = first * y2 - second * y1, second * x1 - first * x2
    u, v = (
        np.stack([np.bincount(owners, each[:, axis], charts.n_charts) for axis in range(3)], axis=1)
        for each in (along, up)
    )
    mirror_u, mirror_v = (
        each[partners] - 2.0 * pm.vecdot(each[partners], normal)[:, None] * normal
        for each in (u, v)
    )
    # The reflection that maps one layout to the other at best: by twice the angle of its axis.
    cos = pm.vecdot(u, mirror_u) - pm.vecdot(v, mirror_v)
    sin = pm.vecdot(u, mirror_v) + pm.vecdot(v, mirror_u)
    return np.asarray(-pm.arctan2(sin, cos))
