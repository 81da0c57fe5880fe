"""Strips, and tubes that were cut open, laid out as rectangles along u and v.

A chart is a strip if its outline has four corners and is longer than wide. Its border is laid on a
rectangle, at distances as in space, and the faces inside follow with least distortion. The chart
keeps its old layout where a face would flip, or stretch exceeds a bound. Opposite sides of a cut
that runs along a tube have the same lengths, so a texture continues across it.

Kernel: `core/flatten.c`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.cutting.body import cut_tube_open
from texbake.mapping.atlas.cutting.parts import Part, connected_parts, split_parts
from texbake.mapping.atlas.flatten import flatten
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.mesh.topology import (
    EdgeGraph,
    edge_keys,
    next_half_edges,
    opposite_half_edges,
    path_back,
)
from texbake.parallel import run_bands

MOST_L2 = 1.1  # stretch of a rectangle, at most
# Length of a tube cut open, in sides of a square as large as all charts. A longer one is divided,
# or it would set the scale of all others.
_LONGEST = 1.15
_FEW = 6  # faces of a tube, at least
_HARD = 0.5  # cosine of the angle between faces at a hard edge, 60° or more
_FLAT = 0.5  # share of the normals of a ring that do not cancel, at most
_ROUNDING = 1e-9  # of places on a side of a rectangle, as a share of its width
_LEAST_ASPECT = 1.5  # length of a strip in its widths
_LEAST_RATIO = 0.5  # of the lengths of opposite sides
# A corner is where the outline turns by 60° or more, within this share of the width to each side,
# and turns by 45° or less beyond the four corners.
_REACH = 0.7
_CORNER, _NO_CORNER = math.radians(60.0), math.radians(45.0)
_ITERATIONS, _ACCURACY = 50, 1e-4


def with_rectangles(
    points: FloatArray,
    mesh_faces: IntArray,
    charts: Charts,
    most_l2: float,
    *,
    least_aspect: float = _LEAST_ASPECT,
    threads: int | None = None,
) -> Charts:
    """Lay strips out as rectangles, and find rectangles; `points` (V, 3) in the charts' unit."""
    places = np.zeros((len(charts.uvs), 3))
    places[charts.packed_faces] = points[charts.packed(mesh_faces)]
    faces = charts.packed_faces[charts.packed_faces[:, 0] != charts.packed_faces[:, 1]]
    owners = charts.chart_ids[faces[:, 0]]
    order = np.argsort(owners, kind="stable")
    sizes = np.bincount(owners, minlength=charts.n_charts)
    groups = np.split(faces[order], np.cumsum(sizes)[:-1])
    uvs = charts.uvs.copy()

    def lay(first: int, last: int) -> None:
        for chart in range(first, last):
            vertices, flat = np.unique(groups[chart], return_inverse=True)
            own: IntArray = flat.reshape(-1, 3).astype(np.int32)
            loop, layout = _outline(own), charts.uvs[vertices]
            corners = None if loop is None else _corners(layout[loop])
            if loop is None or corners is None:
                continue
            found = _rectangle(places[vertices], own, loop, corners, most_l2, least_aspect)
            if found is not None:
                uvs[vertices] = found

    run_bands(lay, charts.n_charts, band=1, threads=threads)
    return replace(charts, uvs=uvs)


def tube_charts(surface: ChartSurface, most_l2: float) -> list[tuple[IntArray, Charts]]:
    """Faces (m,) and charts of parts that are tubes, tori or long strips, as rectangles.

    Tubes may also lie between hard edges, as a pipe between its caps.
    """
    corners, solid, opposite = surface.joints
    points = surface.points[corners]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    across = normals[opposite // 3]
    cosines = pm.vecdot(np.repeat(normals, 3, axis=0), across)
    lengths = pm.norm(normals, axis=1)
    is_hard = cosines < _HARD * np.repeat(lengths, 3) * lengths[opposite // 3]
    weights = np.where(_is_within_polygon(surface, opposite), np.inf, 1.0)
    is_hard &= np.isfinite(weights)
    found: list[tuple[IntArray, Charts]] = []
    for around, strips in (opposite, True), (np.where(is_hard, -1, opposite), False):
        parts = split_parts(around, np.where(solid, connected_parts(around), -1))
        laid = _laid(surface, parts, weights.reshape(-1, 3), strips, most_l2)
        for part, charts in zip(parts, laid, strict=True):
            if charts is not None:
                found.append((part.face_ids, charts))
                solid = solid & ~np.isin(np.arange(len(solid)), part.face_ids)
    return found


def _is_within_polygon(surface: ChartSurface, opposite: IntArray) -> BoolArray:
    """(3 F,) half-edges between two triangles of one polygon."""
    polygons = surface.polygons
    if polygons is None:
        return np.zeros(len(opposite), dtype=bool)
    same: BoolArray = polygons[opposite // 3] == np.repeat(polygons, 3)
    return same & (opposite >= 0)


def _laid(
    surface: ChartSurface, parts: list[Part], weights: FloatArray, strips: bool, most_l2: float
) -> list[Charts | None]:
    """Charts of parts that are tubes, or long strips too; None for others.

    `weights` (F, 3): infinite for edges that no seam may follow.
    """
    points = surface.points[surface.corners]
    longest = _LONGEST * math.sqrt(float(surface_areas(points).sum()))
    found: list[Charts | None] = [None] * len(parts)

    def unroll(first: int, last: int) -> None:
        for number in range(first, last):
            face_ids = parts[number].face_ids
            own, costs = points[face_ids], weights[face_ids].ravel()
            if len(own) < _FEW:
                continue
            opened = cut_tube_open(own, parts[number].opposite, costs)
            if opened is None or (not strips if opened[2] is None else _is_flat_ring(own)):
                continue
            faces, first_corners, ends = opened
            places = own.reshape(-1, 3)[first_corners]
            charts = _unrolled(places, faces, costs, ends, most_l2, longest)
            if charts is not None:
                mesh_faces = surface.faces[face_ids]
                found[number] = with_rectangles(
                    surface.points, mesh_faces, charts, most_l2, least_aspect=1.0, threads=1
                )

    run_bands(unroll, len(parts), band=1, threads=surface.threads)
    return found


def _is_flat_ring(points: FloatArray) -> bool:
    """Whether the normals of faces (m, 3, 3) do not cancel, as those of a tube do."""
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    return bool(pm.norm(normals.sum(axis=0)) > _FLAT * pm.norm(normals, axis=1).sum())


def _unrolled(
    points: FloatArray,
    faces: IntArray,
    weights: FloatArray,
    ends: IntArray | None,
    most_l2: float,
    longest: float,
) -> Charts | None:
    """Charts of a strip, or a tube that was cut open, by the vertices at its corners if known."""
    loop = _outline(faces)
    if loop is None:
        return None
    if ends is None:
        flat = flatten(points, faces)
        corners = None if flat is None else _corners(flat.uvs[loop])
    else:
        corners = np.flatnonzero(np.isin(loop, ends)).astype(np.int32)
    if corners is None:
        return None
    least_aspect = _LEAST_ASPECT if ends is None else 1.0
    laid = _rectangle(points, faces, loop, corners, most_l2, least_aspect)
    return None if laid is None else _divided(laid, faces, weights, longest)


def _divided(
    uvs: FloatArray, faces: IntArray, weights: FloatArray, longest: float
) -> Charts | None:
    """Charts of a rectangle, cut across along edges into equal ones where it is too long.

    None if it cannot be cut, by the `weights` (3 m,) of its edges.
    """
    (left, low), (right, high) = uvs.min(axis=0), uvs.max(axis=0)
    n_parts = max(math.ceil((right - left) / longest), 1)
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    starts, ends = np.concatenate([[tails, heads], [heads, tails]], axis=1)
    costs = pm.norm(uvs[ends] - uvs[starts], axis=1) * np.tile(weights, 2)
    graph = EdgeGraph.build(len(uvs), starts, ends, costs)
    sides = [np.flatnonzero(np.abs(uvs[:, 1] - y) < _ROUNDING * (high - low)) for y in (low, high)]
    opposite, keys = opposite_half_edges(faces), edge_keys(tails, heads)
    for part in range(1, n_parts):
        place = left + (right - left) * part / n_parts
        start, end = (int(side[np.abs(uvs[side, 0] - place).argmin()]) for side in sides)
        distances, before = graph.paths_from(start, end)
        if not np.isfinite(distances[end]):
            return None
        path = np.array(path_back(before, end))
        opposite = np.where(np.isin(keys, edge_keys(path[1:], path[:-1])), -1, opposite)
    owners = connected_parts(opposite)
    used, corners = np.unique(owners[:, None].astype(np.int64) << 32 | faces, return_inverse=True)
    return Charts(
        uvs=uvs[used & 0xFFFFFFFF],
        faces=corners.reshape(-1, 3).astype(np.int32),
        chart_ids=(used >> 32).astype(np.int32),
    )


def _rectangle(
    points: FloatArray,
    faces: IntArray,
    loop: IntArray,
    corners: IntArray,
    most_l2: float,
    least_aspect: float,
) -> FloatArray | None:
    """(n, 2) layout of a chart as a rectangle, longer in u, by its outline and the corners of that.

    None if it is too short, opposite sides differ too much in length, or it stretches too much.
    """
    loop = np.roll(loop, -corners[0])
    ends = [*(corners - corners[0]), len(loop)]
    closed = np.append(loop, loop[0])
    steps = pm.norm(points[closed[1:]] - points[closed[:-1]], axis=1)
    along = [np.cumsum(steps[first:last]) for first, last in pairwise(ends)]
    sides = [float(side[-1]) for side in along]
    if sides[0] + sides[2] < sides[1] + sides[3]:  # the first side is a long one
        along, sides, loop = [*along[1:], along[0]], [*sides[1:], sides[0]], np.roll(loop, -ends[1])
    length, width = (sides[0] + sides[2]) / 2.0, (sides[1] + sides[3]) / 2.0
    ratios = [min(a, b) / max(a, b, np.finfo(float).tiny) for a, b in (sides[::2], sides[1::2])]
    if length < least_aspect * width or min(ratios) < _LEAST_RATIO:
        return None
    # Shares of the side that lie behind each vertex, from its first corner on.
    shares = [np.append(0.0, side[:-1] / side[-1]) for side in along]
    x = [shares[0], np.ones_like(shares[1]), 1.0 - shares[2], np.zeros_like(shares[3])]
    y = [np.zeros_like(shares[0]), shares[1], np.ones_like(shares[2]), 1.0 - shares[3]]
    uvs, fixed = np.zeros((len(points), 2)), np.zeros(len(points), dtype=bool)
    uvs[loop] = np.stack([np.concatenate(x) * length, np.concatenate(y) * width], axis=1)
    fixed[loop] = True
    figures = np.empty(3)
    is_laid = core.flatten_within(points, faces, fixed, _ITERATIONS, _ACCURACY, uvs, figures)
    return uvs if is_laid and figures[0] <= most_l2 and figures[2] else None


def _outline(faces: IntArray) -> IntArray | None:
    """(k,) vertices along the border, counter-clockwise; None unless it is one loop."""
    border = np.flatnonzero(opposite_half_edges(faces) < 0)
    starts, ends = faces.ravel()[border], faces.ravel()[next_half_edges(border)]
    after = dict(zip(starts.tolist(), ends.tolist(), strict=True))
    if len(after) < max(len(border), 4):
        return None
    loop = [int(starts[0])]
    while after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    return np.array(loop, dtype=np.int32) if len(loop) == len(border) else None


def _corners(outline: FloatArray) -> IntArray | None:
    """(4,) ascending places of the corners along an outline (k, 2); None unless it has four."""
    n = len(outline)
    around = np.concatenate([outline, outline, outline, outline[:1]])
    steps = pm.norm(around[1:] - around[:-1], axis=1)
    at = np.append(0.0, np.cumsum(steps))
    after = np.roll(outline, -1, axis=0)
    area = float((outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]).sum()) / 2.0
    length = float(steps[:n].sum())
    reach = _REACH * 2.0 * area / length
    if not 0.0 < reach < length / 4.0:
        return None
    here = at[n : 2 * n]
    back, ahead = (_along(around, at, here + way) for way in (-reach, reach))
    before, behind = outline - back, ahead - outline
    cross = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0]
    turns = np.asarray(pm.arctan2(cross, (before * behind).sum(axis=1)))
    found: list[int] = []
    while len(found) < 4:
        found.append(int(turns.argmax()))
        if turns[found[-1]] < _CORNER:
            return None
        distances = np.abs(here - here[found[-1]])
        turns[np.minimum(distances, length - distances) < reach] = 0.0
    return np.sort(found).astype(np.int32) if turns.max() <= _NO_CORNER else None


def _along(line: FloatArray, at: FloatArray, places: FloatArray) -> FloatArray:
    """(k, 2) points of a line (n, 2) at places along it; `at` (n,): those of its vertices."""
    first = np.clip(np.searchsorted(at, places, side="right") - 1, 0, len(at) - 2)
    steps = np.maximum(at[first + 1] - at[first], np.finfo(np.float64).tiny)
    shares = ((places - at[first]) / steps)[:, None]
    return np.asarray(line[first] + shares * (line[first + 1] - line[first]))
