"""Neighbors in space near each other in the texture, and mirror images as mirror images.

Charts are exchanged, moved and turned within a layout, which keeps its scale, so that both sides of
seams come closer, and mirror images of charts are mirror images in the texture, too.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.neighbors import Neighbors
from texbake.mapping.atlas.packing.bitmaps import (
    ChartRotations,
    Outlines,
    PackingGrid,
    Shapes,
    shapes_of,
)
from texbake.mapping.atlas.packing.refine import SNAP_MARGIN, FinalLayout
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray

# Cost of a pair of mirror images that do not mirror each other in the layout: as if all seams were
# longer by this share of a side of the texture.
_NOT_MIRRORED = 0.1
_QUARTER, _HALF = 8, 16  # turns, in steps of directions


def move_nearer(
    poses: ChartRotations,
    shapes: Shapes,
    places: IntArray,
    directions: IntArray,
    *,
    scale: float,
    margin: float,
    size: tuple[int, int],
    most_work: int,
) -> IntArray:
    """Exchange, move and turn charts; (C, 3) places, those of row -1 are not in the layout.

    `directions` (C, O): of charts in each orientation, in 16ths of half a turn; those of a chart
    and its mirror image add up to half turns. Kernel: `core/near_places.c`.
    """
    chart_ids = poses.charts.chart_ids
    charts = np.flatnonzero(places[:, 1] >= 0).astype(np.int32)
    neighbors = _among(poses.charts, charts)
    ids = np.full(len(places) + 1, -1, dtype=np.int32)
    ids[charts] = np.arange(len(charts))
    owners = ids[chart_ids[neighbors.seams[:, :, 0]]]
    order = np.argsort(owners.ravel(), kind="stable")
    moved, result = places[charts], places.copy()
    if not len(owners) and (neighbors.partners < 0).all():
        return result
    core.move_nearer(
        shapes.boxes[charts], shapes.spans, shapes.starts[charts], shapes.reach,
        shapes.reach_starts[charts], shapes.margin, owners,
        _seam_sides(neighbors, poses, scale, margin),
        neighbors.weights / max(float(neighbors.weights.sum()), 1e-300),
        np.searchsorted(owners.ravel()[order], np.arange(len(charts) + 1)),
        (order // 2).astype(np.int32), ids[neighbors.partners[charts]], directions[charts],
        _NOT_MIRRORED * max(size), size[1], size[0], most_work, moved,
    )  # fmt: skip
    result[charts] = moved
    return result


def _among(charts: Outlines, ids: IntArray) -> Neighbors:
    """The neighbors among some charts (n,)."""
    neighbors = charts.neighbors
    assert neighbors is not None
    chosen = np.zeros(charts.n_charts + 1, dtype=bool)
    chosen[ids] = True
    inside = chosen[charts.chart_ids[neighbors.seams[:, :, 0]]].all(axis=1)
    return replace(
        neighbors,
        seams=neighbors.seams[inside],
        weights=neighbors.weights[inside],
        partners=np.where(chosen[neighbors.partners], neighbors.partners, np.int32(-1)),
    )


def _seam_sides(
    neighbors: Neighbors, poses: ChartRotations, scale: float, margin: float
) -> IntArray:
    """(S, 2, 4 K, 2) int32: the middle of sides of seams, in cells of charts in quarter turns."""
    owners = poses.charts.chart_ids[neighbors.seams[:, :, 0]]
    boxes, shifts = poses.frames(scale, margin)
    width, height = np.moveaxis(boxes[owners], -1, 0)
    middles = poses.uvs[neighbors.seams].mean(axis=2) * scale + shifts[owners]
    x, y = np.moveaxis(middles, -1, 0)
    turns = [(x, y), (height - y, x), (width - x, height - y), (y, width - x)]
    sides = np.stack([np.stack(turn, axis=-1) for turn in turns], axis=3)
    n_orientations = sides.shape[2] * sides.shape[3]
    return np.asarray(np.rint(sides).reshape(-1, 2, n_orientations, 2), dtype=np.int32)


def seam_distance(poses: ChartRotations, places: IntArray, *, scale: float, margin: float) -> float:
    """Mean distance between both sides of seams, in cells, of charts at places (C, 3)."""
    neighbors = poses.charts.neighbors
    assert neighbors is not None
    if not len(neighbors.seams):
        return 0.0
    there = places[poses.charts.chart_ids[neighbors.seams[:, :, 0]]]
    sides = _seam_sides(neighbors, poses, scale, margin)
    at = np.take_along_axis(sides, there[:, :, 2, None, None], axis=2)[:, :, 0] + there[:, :, :2]
    lengths = pm.norm((at[:, 0] - at[:, 1]).astype(np.float64), axis=1)
    return float((neighbors.weights * lengths).sum() / neighbors.weights.sum())


def pose_directions(poses: ChartRotations) -> IntArray:
    """(C, 4 K) int32: directions of poses spread evenly over a quarter turn, in quarter turns."""
    charts, n_poses = poses.charts, poses.uvs.shape[1]
    steps = np.tile(np.arange(n_poses) * _QUARTER // n_poses, (charts.n_charts, 1))
    if charts.aligned is not None:
        steps[charts.aligned] = 0
    directions = steps[:, :, None] + _QUARTER * np.arange(4)
    return (directions.reshape(charts.n_charts, -1) % _HALF).astype(np.int32)


def mirrored_pairs(neighbors: Neighbors, directions: IntArray, orientations: IntArray) -> BoolArray:
    """(C,) charts whose mirror images mirror them in the layout, too."""
    own, partners = directions[np.arange(len(directions)), orientations], neighbors.partners
    return np.asarray((partners >= 0) & ((own + own[partners]) % _HALF == 0))


def nearer_layout(
    found: FinalLayout, tiles: IntArray, grid: PackingGrid, most_work: int
) -> FinalLayout:
    """Exchange, move and turn charts of a layout within their tiles (C,)."""
    charts, ids = found.poses.charts, np.arange(len(tiles))
    pose = found.places[:, 2]
    uvs = found.poses.uvs[np.arange(len(charts.uvs)), pose[charts.chart_ids]]
    low, extents = (each[ids, pose][:, None] for each in (found.poses.low, found.poses.extents))
    directions = _quarter_directions(charts, uvs)
    poses = ChartRotations(uvs=uvs[:, None], charts=charts, low=low, extents=extents)
    margin = SNAP_MARGIN / grid.cell
    bitmaps = poses.bitmaps(found.scale, margin)
    shapes = shapes_of(bitmaps, grid.half_widths, turns=4)
    places = np.zeros_like(found.places)
    for tile in np.unique(tiles):
        own = tiles == tile
        moved = move_nearer(
            poses, shapes, np.where(own[:, None], found.places[:, [0, 1, 3]], np.int32(-1)),
            directions, scale=found.scale, margin=margin, size=(grid.width, grid.height),
            most_work=most_work * int(own.sum()) // len(own),
        )  # fmt: skip
        places[np.ix_(own, [0, 1, 3])] = moved[own]
    return FinalLayout(poses=poses, bitmaps=bitmaps, places=places, scale=found.scale)


def _quarter_directions(charts: Outlines, uvs: FloatArray) -> IntArray:
    """(C, 4) int32: of `uvs` (T, 2) in quarter turns, rounded to mirror partners."""
    assert charts.neighbors is not None
    partners, angles = charts.neighbors.partners, _angles(charts, uvs)
    turns = np.rint((angles + angles[partners]) / (math.pi / 2.0))
    turns = np.where(np.arange(charts.n_charts) > partners, turns, 0.0)
    directions = _QUARTER * (turns[:, None] + np.arange(4)) % _HALF
    return np.asarray(directions, dtype=np.int32)


def _angles(charts: Outlines, uvs: FloatArray) -> FloatArray:
    """(C,) radians by which charts are rotated to coordinates (T, 2)."""
    first = np.unique(charts.chart_ids, return_index=True)[1][charts.chart_ids]
    x, y = (charts.uvs - charts.uvs[first]).T
    u, v = (uvs - uvs[first]).T
    cross, dot = (np.bincount(charts.chart_ids, each) for each in (x * v - y * u, x * u + y * v))
    return np.asarray(pm.arctan2(cross, dot))
