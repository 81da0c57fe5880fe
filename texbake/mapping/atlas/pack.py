"""Charts into a texture of exactly the size asked for, as large as they fit.

Each chart is rasterized to the cells it touches and put where it lies lowest, then leftmost, among
the charts already there, in whichever of four rotations ends lowest; large charts come first, and
small ones find their way into gaps and holes. The scale, one for all charts so that texels are
square and of one density, is bisected until a slightly larger one would no longer fit.

A cell is one texel, or a square of some where the texture is so large that single texels would
cost much and gain little. Distances are exact in texels either way, never less than asked for.

Based on: Bruno Lévy, Sylvain Petitjean, Nicolas Ray, Jérome Maillot, "Least squares conformal maps
for automatic texture atlas generation", 2002 (packing charts by their shape, large ones first). It
departs in searching the whole bitmap instead of its horizon, so that holes are filled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texbake.errors import UnwrapError
from texbake.mapping.areas import signed_areas
from texbake.mapping.atlas.bitmaps import Grid, place_charts, rasterize_charts
from texbake.mesh.mesh import FloatArray, IntArray

_MOST_CELLS = 1024  # cells along the longer side of the grid

# Texels that a chart is taken to reach beyond its edge: half a unit of the 1/256 texel that
# rasterizers snap to. Also more than float32 loses of a coordinate in a file.
_SNAP_MARGIN = 1.0 / 512.0

_FIRST_GUESS = 0.6  # of the texture filled
_SCALE_STEP = 0.004  # relative; one texel in 250

# Few charts are tried in many poses and orders, many charts in few, so that the work is bounded.
_MOST_POSED = 256
_MOST_POSES = 4
_MOST_ORDERS = 32
_MANY_CHARTS = 1024

_GOLDEN_RATIO = 0.6180339887498949  # its multiples, modulo 1, are spread evenly


@dataclass(frozen=True, kw_only=True, eq=False)
class Packing:
    """Charts in their places.

    Attributes
    ----------
    uvs : (T, 2) float64
        Texture coordinates, in the unit square.
    texels_per_unit : float
        Texels along a length of 1 of the coordinates that came in.
    fill : float
        Area of the charts as a share of the texture.
    """

    uvs: FloatArray
    texels_per_unit: float
    fill: float


def pack_charts(
    uvs: FloatArray,
    faces: IntArray,
    chart_ids: IntArray,
    *,
    size: tuple[int, int],
    padding: int,
    name: str = "mesh",
) -> Packing:
    """Turn, scale and move charts so that they fill a texture.

    Parameters
    ----------
    uvs : (T, 2) float64
        Coordinates of each chart about its own origin, all in one unit of length.
    faces : (F, 3) int32
        Indices into `uvs`; the three lie in one chart.
    chart_ids : (T,) int32
        Chart of each coordinate, from 0 without gaps.
    size : (int, int)
        Texels in a row, and rows.
    padding : int
        Texels that may be padded around each chart: of two texels that different charts touch, the
        centers lie more than `2 * padding` apart, and at least `padding` texels lie between a
        texel that a chart touches and the border.
    name : str
        What an error calls the mesh.

    Returns
    -------
    Packing
        Charts are rotated, never mirrored. A chart without area takes one cell.

    Raises
    ------
    UnwrapError
        There are too many charts for so few texels, with so much padding.
    """
    uvs = _turned_to_least_boxes(uvs, chart_ids)
    grid = Grid.over(size, padding, most_cells=_MOST_CELLS)
    layout = _Layout(uvs, faces, chart_ids, grid)
    scale = _largest_scale(layout)
    if scale is None:
        raise UnwrapError(
            f"{name}: {layout.n_charts} charts do not fit into {size[0]} x {size[1]} texels with "
            f"a padding of {padding}; take a larger size or less padding"
        )
    packed = (layout.placed_uvs() * grid.cell + padding) / np.array(size, dtype=np.float64)
    area = float(np.abs(signed_areas(packed[faces])).sum())
    return Packing(uvs=packed, texels_per_unit=scale * grid.cell, fill=area)


class _Layout:
    """Charts in several poses, and the places that the last scale tried gave them.

    A pose is a chart turned by some angle of less than 90 degrees; the first is that of the least
    bounding box. Arrays of poses have the pose second: (charts, poses, ...).
    """

    def __init__(self, uvs: FloatArray, faces: IntArray, chart_ids: IntArray, grid: Grid) -> None:
        self.n_charts = int(chart_ids.max()) + 1
        self.grid = grid
        n_poses = min(max(_MOST_POSED // self.n_charts, 1), _MOST_POSES)
        angles = np.arange(n_poses) * (math.pi / 2.0 / n_poses)
        self._uvs = np.stack([_turned(uvs, np.full(len(uvs), angle)) for angle in angles], axis=1)
        self._chart_ids = chart_ids
        self._corners = np.ascontiguousarray(self._uvs[faces])
        self._face_charts = np.ascontiguousarray(chart_ids[faces[:, 0]])
        low, high = (np.full((self.n_charts, n_poses, 2), side) for side in (np.inf, -np.inf))
        np.minimum.at(low, chart_ids, self._uvs)
        np.maximum.at(high, chart_ids, self._uvs)
        self._low, self._extents = low, high - low
        self.area = float(np.abs(signed_areas(uvs[faces])).sum())
        # Half the perimeter: what xatlas sorts by as well.
        self.sizes = self._extents[:, 0].sum(axis=1)
        self._scale_tried = math.nan

    def try_scale(self, scale: float, order: IntArray) -> bool:
        """Place all charts at a scale, in cells a unit, one after another; whether they fit."""
        most = max(self.grid.width, self.grid.height)
        if (self._extents.max(axis=2).min(axis=1) * scale > most).any():
            return False
        if scale != self._scale_tried:  # else only the order is another one
            self._scale_tried = scale
            self._bitmaps_tried = rasterize_charts(
                self._corners,
                self._face_charts,
                self._low,
                self._extents,
                scale=scale,
                margin=_SNAP_MARGIN / self.grid.cell,
            )
        places = place_charts(
            self._bitmaps_tried, order, self.grid, hurried=self.n_charts > _MANY_CHARTS
        )
        if places is None:
            return False
        self._scale, self._bitmaps, self._places = scale, self._bitmaps_tried, places
        return True

    def placed_uvs(self) -> FloatArray:
        """(T, 2) float64: the coordinates at the last scale that fit, in cells of the grid."""
        places = self._places[self._chart_ids]
        pose, turns = places[:, 2], places[:, 3]
        shifts = self._bitmaps.shifts[self._chart_ids, pose]
        x, y = (self._uvs[np.arange(len(pose)), pose] * self._scale + shifts).T
        width, height = self._bitmaps.boxes[self._chart_ids, pose].T
        turned = (
            np.choose(turns, [x, height - y, width - x, y]),
            np.choose(turns, [y, x, height - y, width - x]),
        )
        return np.asarray(np.stack(turned, axis=1) + places[:, :2])


def _largest_scale(layout: _Layout) -> float | None:
    """Find the largest scale that fits and leave the layout at it; None where none does."""
    grid = layout.grid
    n_cells = grid.width * grid.height
    if n_cells <= 0 or layout.n_charts > n_cells:
        return None
    order = np.argsort(-layout.sizes, kind="stable").astype(np.int32)
    longest = float(layout.sizes.max())
    if layout.area <= 0.0:
        return 1.0 if layout.try_scale(1.0, order) else None
    fits, too_large = 0.0, 2.0 * max(grid.width, grid.height) / longest
    scale = min(math.sqrt(_FIRST_GUESS * n_cells / layout.area), too_large)
    step = 1.08
    while too_large - fits > _SCALE_STEP * too_large:
        if layout.try_scale(scale, order):
            fits = scale
            scale = min(scale * step, (fits + too_large) / 2.0)
        else:
            too_large = scale
            scale = max(scale / step, (fits + too_large) / 2.0)
            step *= step  # ever faster down to where the first one fits
        if too_large * longest < 0.01:  # every chart is one cell already, and still too many
            return None
    # Other orders, nearly by size, may fit at a larger scale.
    ids = np.arange(layout.n_charts)
    for trial in range(min(_MOST_POSED // layout.n_charts, _MOST_ORDERS)):
        noise = (_GOLDEN_RATIO * (trial * layout.n_charts + ids)) % 1.0 - 0.5
        order = np.argsort(-layout.sizes * np.exp(noise), kind="stable").astype(np.int32)
        while layout.try_scale(fits * (1.0 + _SCALE_STEP), order):
            fits *= 1.0 + _SCALE_STEP
    return fits


def _turned(uvs: FloatArray, angles: FloatArray) -> FloatArray:
    """Rotate coordinates counter-clockwise, each by its own angle in radians."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([uvs[:, 0] * cos - uvs[:, 1] * sin, uvs[:, 0] * sin + uvs[:, 1] * cos], axis=1)


def _turned_to_least_boxes(uvs: FloatArray, chart_ids: IntArray) -> FloatArray:
    """Rotate each chart so that its bounding box has the least area of 90 directions."""
    n_charts = int(chart_ids.max()) + 1
    best_areas = np.full(n_charts, np.inf)
    best_angles = np.zeros(n_charts)
    order = np.argsort(chart_ids, kind="stable")
    starts = np.searchsorted(chart_ids[order], np.arange(n_charts))
    for angle in np.radians(np.arange(90)):
        turned = _turned(uvs[order], np.full(len(uvs), angle))
        extents = np.maximum.reduceat(turned, starts) - np.minimum.reduceat(turned, starts)
        areas = extents.prod(axis=1)
        better = areas < best_areas * (1.0 - 1e-9)  # not by rounding alone
        best_areas[better], best_angles[better] = areas[better], angle
    return _turned(uvs, best_angles[chart_ids])
