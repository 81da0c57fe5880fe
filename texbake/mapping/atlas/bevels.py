"""Bevels: narrow faces that turn a hard edge over several soft ones.

Coplanar neighbors form a region. Narrow regions count as rounded margins of a wide one next to
them, as long as they turn little away from it. Where a margin meets a region that turns more, the
edge is as hard as one between the wide regions on both sides.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.distance import area_vectors
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.records import dataclass

# Neighbors that turn by less, in degrees, are coplanar.
_COPLANAR = 1.0
# Least length of the mean normal of a planar region: a dense sphere has coplanar neighbors, too.
_PLANAR = 0.999
# Least width of a plane that is kept whole, in sides of a square as large as the surface.
_WIDE = 0.02
# Most width of a region in the margin of another, most width of a margin, in widths of the other,
# the latter also where the other is a wide plane; most angle between their normals, in degrees.
_NARROW, _MARGIN, _MARGIN_OF_PLANE, _TURN = 0.25, 0.2, 0.3, 60.0
_MOST_REGIONS = 8  # of a margin, from the wide region outwards


@dataclass(frozen=True, kw_only=True, eq=False)
class Bevels:
    """The hard edges of a surface, beveled or not."""

    edges: IntArray  # (k,) int32; half-edges with an opposite
    # (k,) float64; degrees between the faces at them; at the end of a margin, at least those
    # between the wide regions on both sides
    angles: FloatArray
    within: BoolArray  # (k,); whether they lie within a plane that is wide enough to be kept whole
    # (F, 3) float64; normals of faces, of any length; in a margin, that of the wide region
    normals: FloatArray
    planes: IntArray  # (F,) int32; the wide plane that each face is in, or -1
    owners: IntArray  # (F,) int32; the wide plane that each face is in the margin of, or in, or -1


def find_bevels(points: FloatArray, corners: IntArray, opposite: IntArray) -> Bevels:
    """Find bevels, of faces with `corners` (F, 3); `opposite` (3 F,) int32, -1 for none."""
    edges = np.flatnonzero(opposite >= 0).astype(np.int32)
    one, other = edges // 3, opposite[edges] // 3
    crosses = area_vectors(points, corners)
    angles = angles_between(crosses[one], crosses[other])
    flat = angles < _COPLANAR
    labels = merged_labels(len(corners), one[flat], other[flat])
    first, second = labels[one[~flat]], labels[other[~flat]]
    sizes = np.bincount(labels, surface_areas(points[corners]), minlength=len(labels))
    areas = np.asarray(sizes, dtype=np.float64)
    widths = 2.0 * areas / _perimeters(points, corners, labels, edges[flat])
    sums = [np.bincount(labels, crosses[:, axis], minlength=len(labels)) for axis in range(3)]
    normals = np.stack(sums, axis=1).astype(np.float64)
    is_planar = pm.norm(normals, axis=1) >= 2.0 * _PLANAR * areas
    is_wide = is_planar & (widths >= _WIDE * math.sqrt(float(areas.sum())))
    owners = _owners(first, second, areas, np.where(is_planar, widths, 0.0), normals, is_wide)
    ends = owners[first], owners[second]
    meet = np.flatnonzero((ends[0] != ends[1]) & ((ends[0] != first) | (ends[1] != second)))
    between = angles_between(normals[ends[0][meet]], normals[ends[1][meet]])
    places = np.flatnonzero(~flat)[meet]
    angles[places] = np.maximum(angles[places], np.where(between > _TURN, between, 0.0))
    owner = owners[labels]
    is_margin = (owner != labels)[:, None]
    return Bevels(
        edges=edges,
        angles=angles,
        within=flat & is_wide[labels[one]],
        normals=np.where(is_margin, normals[owner], crosses),
        planes=np.where(is_wide[labels], labels, -1).astype(np.int32),
        owners=np.where(is_wide[owner], owner, -1).astype(np.int32),
    )


def labels_of_planes(
    planes: IntArray,
    labels: IntArray,
    polygons: IntArray | None = None,
    *,
    least_share: float = 0.0,
) -> IntArray:
    """(F,) labels of faces; those of a plane get the most frequent one if its share is enough.

    Faces of no label, -1, keep it, and polygons that would get several labels keep theirs.
    """
    own = np.flatnonzero((planes >= 0) & (labels >= 0))
    pairs, counts = np.unique(planes[own].astype(np.int64) << 32 | labels[own], return_counts=True)
    order = np.lexsort((counts, pairs >> 32))
    last = order[np.searchsorted(pairs[order] >> 32, planes[own], side="right") - 1]
    is_enough = counts[last] >= least_share * np.bincount(planes[own])[planes[own]]
    found = labels.copy()
    found[own[is_enough]] = pairs[last[is_enough]] & 0xFFFFFFFF
    if polygons is None:
        return found
    valid = labels >= 0
    pairs = np.unique(polygons[valid].astype(np.int64) << 32 | found[valid])
    numbers, counts = np.unique(pairs >> 32, return_counts=True)
    return np.where(np.isin(polygons, numbers[counts > 1]), labels, found)


def _perimeters(
    points: FloatArray, corners: IntArray, labels: IntArray, within: IntArray
) -> FloatArray:
    """(F,) length of the border of each region; `within`: half-edges inside regions."""
    ends = points[corners] - points[np.roll(corners, -1, axis=1)]
    lengths = pm.norm(ends.reshape(-1, 3), axis=1)
    lengths[within] = 0.0
    sums = np.bincount(np.repeat(labels, 3), lengths, minlength=len(labels))
    return np.where(sums > 0.0, sums, np.inf)


def angles_between(normals: FloatArray, others: FloatArray) -> FloatArray:
    """(k,) degrees between vectors (k, 3) of any length."""
    crosses = pm.norm(np.cross(normals, others), axis=1)
    return np.asarray(np.degrees(pm.arctan2(crosses, (normals * others).sum(axis=1))))


def _owners(
    first: IntArray,
    second: IntArray,
    areas: FloatArray,
    widths: FloatArray,
    normals: FloatArray,
    is_wide: BoolArray,
) -> IntArray:
    """(F,) the region whose margin each region is in, or itself.

    `first`, `second`: neighboring regions, in both orders. The largest owner takes a region.
    """
    owners = np.arange(len(areas), dtype=np.int32)
    margins = np.where(is_wide, _MARGIN_OF_PLANE, _MARGIN) * widths
    spans = np.zeros(len(areas))  # from the owner to the far side of a region
    reached = np.ones(len(areas), dtype=np.bool_)
    for _ in range(_MOST_REGIONS):
        free = owners[second] == second
        owner = owners[first]
        span = spans[first] + widths[second]
        fits = free & reached[first] & (owner != second) & (span <= margins[owner])
        fits &= widths[second] <= _NARROW * widths[owner]
        near = np.flatnonzero(fits)
        near = near[angles_between(normals[owner[near]], normals[second[near]]) <= _TURN]
        if not len(near):
            break
        near = near[np.lexsort((owner[near], -areas[owner[near]], second[near]))]
        taken, places = np.unique(second[near], return_index=True)
        owners[taken], spans[taken] = owner[near[places]], span[near[places]]
        reached[:] = False
        reached[taken] = True
    return owners
