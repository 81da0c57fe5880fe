"""Symmetric charts: the charts of one half of a mesh are transferred to the other half.

Where the polygons of the halves correspond one to one, layouts are mirrored. Elsewhere, as on
scans, each face gets the chart of the face closest to its mirror image. Charts that meet at the
mirror plane are joined later, as far as stretch allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from texbake.core import core
from texbake.errors import UnwrapError
from texbake.mapping.atlas.charts import Charts, ChartSurface, gather_charts, mesh_of
from texbake.mapping.atlas.cutting.cut import cut_charts
from texbake.mapping.atlas.cutting.repair import NO_CHART, repair_charts
from texbake.mapping.atlas.flatten import relax_charts
from texbake.mapping.atlas.halves import Halves, image_costs
from texbake.mapping.atlas.joining.join import compact_charts, join_charts
from texbake.mapping.atlas.joining.straighten import BORDER_WIDTH, straighten_charts
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.triangle_tree import TriangleTree

_PART_L2 = 1.03  # stretch of the parts of a transferred chart that are joined again, at most
_SMOOTHINGS = 4  # rounds of giving faces the chart of two of their neighbors
# A part of a transferred chart below this share of the chart's faces joins the charts around it.
_LEAST_PART = 0.1


def half_faces(halves: Halves) -> IntArray:
    """Faces to cut: on one side, in the middle, or without a mirror image."""
    return np.flatnonzero(halves.sides >= 0).astype(np.int32)


def half_surface(surface: ChartSurface, halves: Halves) -> ChartSurface:
    """Surface of the faces that are cut, where no chart crosses the plane."""
    regions = np.zeros(len(surface.faces), np.int32) if surface.regions is None else surface.regions
    ids = half_faces(halves)
    return replace(surface, regions=3 * regions + halves.sides).part(ids)


def half_charts(
    mesh: Mesh,
    surface: ChartSurface,
    halves: Halves,
    charts: Charts,
    weights: FloatArray,
    quality: str,
) -> Charts:
    """Symmetric charts of a mesh: `charts` of `half_faces` and their images.

    Except with `fast`, all are relaxed and cut until compact. `weights` (F, 3): costs of edges by
    `edge_weights`.
    """
    ids, others = half_faces(halves), np.flatnonzero(halves.sides < 0).astype(np.int32)
    half = half_surface(surface, halves)
    if quality != "fast":
        charts = compact_charts(half, relax_charts(half, charts))
        charts = straighten_charts(half, charts, weights[ids])
    if halves.twins is not None:
        mirrored = _mirrored(surface, halves, charts, ids, others)
    else:
        mirrored = _transferred(mesh, surface, halves, charts, others, weights, quality)
    pieces = [(ids, charts)] if mirrored is None else [(ids, charts), (others, mirrored)]
    return gather_charts(mesh.faces, pieces)


def stacked_charts(halves: Halves, half: Charts, mesh: Mesh) -> Charts:
    """Charts of a mesh by those of `half_faces`; mirror images share their coordinates."""
    ids, others = half_faces(halves), np.flatnonzero(halves.sides < 0)
    whole = gather_charts(mesh.faces, [(ids, half)])
    assert halves.twins is not None
    faces = whole.faces.copy()
    faces[others] = whole.faces.ravel()[halves.twins[others]]
    stacked = np.zeros(mesh.n_faces, dtype=bool)
    stacked[others] = True
    return replace(whole, faces=faces, n_ignored=half.n_ignored, stacked=stacked)


def _mirrored(
    surface: ChartSurface, halves: Halves, half: Charts, ids: IntArray, others: IntArray
) -> Charts | None:
    """Mirror the layouts of charts."""
    assert halves.twins is not None
    corners = np.full((len(halves.sides), 3), -1, dtype=np.int32)
    corners[ids] = half.faces
    used, faces = np.unique(corners.ravel()[halves.twins[others]], return_inverse=True)
    if not len(used):
        return None
    faces, ids = faces.reshape(-1, 3), half.chart_ids[used].copy()
    ignored = faces[(faces == faces[:, :1]).all(axis=1)]
    alone = np.setdiff1d(ignored, faces[(faces != faces[:, :1]).any(axis=1)])
    chart_ids = ids.astype(np.int64)
    chart_ids[alone] = NO_CHART
    # Quads that the halves divide along different diagonals may fold over.
    return repair_charts(
        surface.points[surface.faces[others]],
        faces,
        half.uvs[used] * np.array([-1.0, 1.0]),
        chart_ids,
        even=False,
    )


def _transferred(
    mesh: Mesh,
    surface: ChartSurface,
    halves: Halves,
    half: Charts,
    others: IntArray,
    weights: FloatArray,
    quality: str,
) -> Charts | None:
    """Cut the other side where the mirror image of one side is cut."""
    part = surface.part(others)
    labels = transferred_labels(surface, halves, half, weights)[others]
    keys = labels.astype(np.int64) << 32
    if part.regions is not None:
        keys += part.regions
    part = replace(part, regions=np.unique(keys, return_inverse=True)[1].astype(np.int32))
    area = float(surface_areas(surface.points[surface.faces]).sum())
    with suppress(UnwrapError):  # none of the faces has an area
        if quality == "fast":  # charts of `best` are larger, so that each is hardly cut again
            weights = weights[others]
            return cut_charts(mesh_of(mesh, part), part, weights=weights, quality="best", area=area)
        charts = cut_charts(mesh_of(mesh, part), part, quality=quality, area=area)
        return relax_charts(part, join_charts(part, charts, most_l2=_PART_L2, most_share=1.0))
    return None


def transferred_labels(
    surface: ChartSurface, halves: Halves, half: Charts, weights: FloatArray
) -> IntArray:
    """(F,) chart of `half` at the mirror image of each face of the other side; else -1.

    Borders run close to the mirror images of those of `half`; `weights` (F, 3): of edges.
    """
    points, faces = surface.points, surface.faces
    ids, others = half_faces(halves), np.flatnonzero(halves.sides < 0).astype(np.int32)
    solid = half.solid & (halves.sides[ids] == 1)
    tree = TriangleTree.build(points, faces[ids[solid]], threads=surface.threads)
    centers = points[faces[others]].mean(axis=1)
    if surface.polygons is not None:
        _, own = np.unique(surface.polygons[others], return_inverse=True)
        counts = np.bincount(own)
        sums = [np.bincount(own, centers[:, axis]) / counts for axis in range(3)]
        centers = np.stack(sums, axis=1)[own]
    _, nearest, _ = tree.closest_points(halves.plane.mirrored(centers), threads=surface.threads)
    labels = np.full(len(faces), -1, dtype=np.int32)
    labels[ids[solid]] = half.chart_ids[half.faces[solid, 0]]
    costs = weights * image_costs(surface, halves, surface.joints[2], labels)
    part = surface.part(others)
    neighbors = part.joints[2].reshape(-1, 3) // 3
    found = _cleaned(labels[ids[solid]][nearest], neighbors, part.polygons)
    core.straighten_borders(
        points, part.corners, part.joints[2], costs[others], BORDER_WIDTH, found
    )
    labels[:] = -1
    labels[others] = found
    return labels


def _cleaned(labels: IntArray, neighbors: IntArray, polygons: IntArray | None) -> IntArray:
    """Smooth the borders of labels (m,) and drop small parts; `neighbors` (m, 3), -1 for none."""
    labels = _without_small_parts(_smoothed(labels, neighbors), neighbors)
    if polygons is not None:
        _, firsts, numbers = np.unique(polygons, return_index=True, return_inverse=True)
        labels = labels[firsts][numbers]
    return labels


def _smoothed(labels: IntArray, neighbors: IntArray) -> IntArray:
    """Give faces the label of two of their neighbors."""
    labels = labels.copy()
    for round_ in range(_SMOOTHINGS):
        around = np.where(neighbors >= 0, labels[neighbors], labels[:, None])
        for side in range(3):
            same = around[:, side] == around[:, (side + 1) % 3]
            change = same & (around[:, side] != labels)
            # Only every second face, since neighbors could otherwise swap labels without end.
            change[round_ % 2 :: 2] = False
            labels[change] = around[change, side]
    return labels


def _without_small_parts(labels: IntArray, neighbors: IntArray) -> IntArray:
    """Relabel small parts of charts like the faces around them."""
    labels = labels.copy()
    for _ in range(_SMOOTHINGS):
        one, side = np.nonzero((neighbors >= 0) & (labels[neighbors] == labels[:, None]))
        parts = merged_labels(
            len(labels), one.astype(np.int32), neighbors[one, side].astype(np.int32)
        )
        sizes, charts = np.bincount(parts), np.bincount(labels, minlength=labels.max() + 1)
        small = sizes[parts] < _LEAST_PART * charts[labels]
        small &= sizes[parts] < sizes[parts].max()
        if not small.any():
            break
        around = np.where(neighbors >= 0, labels[neighbors], -1)
        settled = (around >= 0) & ~small[neighbors] & small[:, None]
        # Each small part joins the chart that it shares most edges with.
        rows, sides = np.nonzero(settled)
        keys = (parts[rows].astype(np.int64) << 32) + around[rows, sides]
        found, counts = np.unique(keys, return_counts=True)
        order = np.argsort(counts, kind="stable")
        target = np.full(len(sizes), -1, dtype=np.int64)
        target[found[order] >> 32] = found[order] & 0xFFFFFFFF
        moved = small & (target[parts] >= 0)
        labels[moved] = target[parts[moved]]
    return labels


def find_counterparts(
    faces: Sequence[IntArray], surface: ChartSurface, halves: Halves
) -> dict[int, int]:
    """Find the mirror image of each chart, by its faces; in the middle, the chart itself."""
    sides, owners = halves.sides, np.full(len(halves.sides), -1, dtype=np.int32)
    for index, face_ids in enumerate(faces):
        owners[face_ids] = index
    images = _images(surface, halves)
    counterparts: dict[int, int] = {}
    for index, face_ids in enumerate(faces):
        side = sides[face_ids[0]]
        if side == 0:
            counterparts[index] = index
        elif side < 0:
            found = images[face_ids]
            found = owners[found[found >= 0]]
            found = found[found >= 0]
            if not len(found):
                continue
            ids, counts = np.unique(found, return_counts=True)
            counterpart = int(ids[counts.argmax()])
            largest = counterparts.get(counterpart)
            if largest is None or len(faces[largest]) < len(face_ids):
                if largest is not None:
                    del counterparts[largest]
                counterparts[index], counterparts[counterpart] = counterpart, index
    return counterparts


def _images(surface: ChartSurface, halves: Halves) -> IntArray:
    """(F,) a face at the mirror image of each face of the other side."""
    if halves.twins is not None:
        return np.asarray(halves.twins[:, 0] // 3)
    points, faces = surface.points, surface.faces
    ids, others = np.flatnonzero(halves.sides == 1), np.flatnonzero(halves.sides < 0)
    tree = TriangleTree.build(points, faces[ids], threads=surface.threads)
    mirrored = halves.plane.mirrored(points[faces[others]].mean(axis=1))
    images = np.full(len(faces), -1, dtype=np.int32)
    images[others] = ids[tree.closest_points(mirrored, threads=surface.threads)[1]]
    return images
