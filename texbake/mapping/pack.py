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
import numpy.typing as npt
from numba import njit

from texbake.errors import UnwrapError
from texbake.mapping.areas import signed_areas
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
    grid = _Grid.over(size, padding)
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


@dataclass(frozen=True, kw_only=True)
class _Grid:
    """Cells between the borders, and how far apart two charts are kept on them.

    Attributes
    ----------
    width, height : int
        Cells in a row, and rows.
    cell : int
        Texels along the side of a cell.
    half_widths : (2 r + 1,) int32
        For cells in the row -r to r from one that a chart touches: cells to either side of it that
        another chart may not touch.
    """

    width: int
    height: int
    cell: int
    half_widths: IntArray

    @classmethod
    def over(cls, size: tuple[int, int], padding: int) -> _Grid:
        """Grid of a texture: its first cell begins `padding` texels from the corner."""
        cell = -(-max(size) // _MOST_CELLS)
        width, height = ((length - 2 * padding) // cell for length in size)
        reach = 2 * padding // cell + 1
        steps = np.arange(reach + 1)
        # Texel centers of two cells n apart are at least this far apart along that axis.
        texels = np.where(steps > 0, steps * cell - (cell - 1), 0)
        # Centers as far apart as 2 padding are too near: a texel in the middle belongs to both.
        near = texels[:, None] ** 2 + texels[None, :] ** 2 <= (2 * padding) ** 2
        counts = near.sum(axis=1)[near.any(axis=1)].astype(np.int32) - 1
        half_widths = np.concatenate([counts[:0:-1], counts])
        return cls(width=width, height=height, cell=cell, half_widths=half_widths)


class _Layout:
    """Charts in several poses, and the places that the last scale tried gave them.

    A pose is a chart turned by some angle of less than 90 degrees; the first is that of the least
    bounding box. Arrays of poses have the pose second: (charts, poses, ...).
    """

    def __init__(self, uvs: FloatArray, faces: IntArray, chart_ids: IntArray, grid: _Grid) -> None:
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

    def try_scale(self, scale: float, order: IntArray) -> bool:
        """Place all charts at a scale, in cells a unit, one after another; whether they fit."""
        grid = self.grid
        margin = _SNAP_MARGIN / grid.cell
        boxes = np.ceil(self._extents * scale + 2.0 * margin).astype(np.int64)
        if (boxes.max(axis=2).min(axis=1) > max(grid.width, grid.height)).any():
            return False
        shifts = (boxes - self._extents * scale) / 2.0 - self._low * scale
        n_cells = boxes.prod(axis=2)
        starts = np.cumsum(n_cells.ravel()).reshape(n_cells.shape) - n_cells
        masks = np.zeros(n_cells.sum(), dtype=np.uint8)
        _mask_kernel(self._corners, self._face_charts, scale, shifts, margin, boxes, starts, masks)
        places = np.empty((self.n_charts, 4), dtype=np.int64)
        runs = np.empty((grid.height, grid.width), dtype=np.int32)
        if not _place_kernel(masks, starts, boxes, order, grid.half_widths, runs, places):
            return False
        self._scale, self._boxes, self._shifts, self._places = scale, boxes, shifts, places
        return True

    def placed_uvs(self) -> FloatArray:
        """(T, 2) float64: the coordinates at the last scale that fit, in cells of the grid."""
        places = self._places[self._chart_ids]
        pose, turns = places[:, 2], places[:, 3]
        shifts = self._shifts[self._chart_ids, pose]
        x, y = (self._uvs[np.arange(len(pose)), pose] * self._scale + shifts).T
        width, height = self._boxes[self._chart_ids, pose].T
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
    while too_large - fits > _SCALE_STEP * too_large:
        if layout.try_scale(scale, order):
            fits = scale
            scale = min(scale * 1.08, (fits + too_large) / 2.0)
        else:
            too_large = scale
            scale = max(scale * 0.92, (fits + too_large) / 2.0)
        if too_large * longest < 0.01:  # every chart is one cell already, and still too many
            return None
    # Other orders, nearly by size, may fit at a larger scale.
    random = np.random.default_rng(0)
    for _ in range(min(_MOST_POSED // layout.n_charts, _MOST_ORDERS)):
        noise = random.normal(0.0, 0.2, layout.n_charts)
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


@njit(nogil=True, cache=True)
def _mask_kernel(corners, face_charts, scale, shifts, margin, boxes, starts, masks):  # type: ignore[no-untyped-def]
    """Mark each cell that a face touches, or comes nearer to than `margin`, in its pose's mask."""
    n_poses = corners.shape[2]
    for item in range(len(corners) * n_poses):
        face, pose = item // n_poses, item % n_poses
        chart = face_charts[face]
        width, height = boxes[chart, pose, 0], boxes[chart, pose, 1]
        x = corners[face, :, pose, 0] * scale + shifts[chart, pose, 0]
        y = corners[face, :, pose, 1] * scale + shifts[chart, pose, 1]
        first = max(int(math.floor(y.min() - margin)), 0)
        last = min(int(math.floor(y.max() + margin)), height - 1)
        for row in range(first, last + 1):
            left, right = _extent_between(x, y, row - margin, row + 1 + margin)
            begin = max(int(math.floor(left - margin)), 0)
            end = min(int(math.floor(right + margin)), width - 1)
            start = starts[chart, pose] + row * width
            masks[start + begin : start + end + 1] = 1


@njit(nogil=True, cache=True)
def _extent_between(x, y, bottom, top):  # type: ignore[no-untyped-def]
    """Least and greatest x of what of a triangle lies between two heights, which it reaches."""
    left, right = np.inf, -np.inf
    for i in range(3):
        x0, y0, x1, y1 = x[i], y[i], x[(i + 1) % 3], y[(i + 1) % 3]
        if max(y0, y1) < bottom or min(y0, y1) > top:
            continue
        t0, t1 = 0.0, 1.0
        if y0 != y1:
            t_bottom, t_top = (bottom - y0) / (y1 - y0), (top - y0) / (y1 - y0)
            t0, t1 = max(0.0, min(t_bottom, t_top)), min(1.0, max(t_bottom, t_top))
        begin, end = x0 + t0 * (x1 - x0), x0 + t1 * (x1 - x0)
        left, right = min(left, begin, end), max(right, begin, end)
    return left, right


@njit(nogil=True, cache=True)
def _place_kernel(masks, starts, boxes, order, half_widths, runs, places):  # type: ignore[no-untyped-def]
    """Put the charts one after another where they end lowest; return whether all found a place.

    `places` gets (x, y, pose, quarter turns) of each chart. `runs` holds for each cell how many
    cells from it rightwards are free, or, negative, are not.
    """
    n_rows, n_columns = runs.shape
    n_poses = boxes.shape[1]
    blocked = np.zeros((n_rows, n_columns), dtype=np.uint8)
    for row in range(n_rows):
        for column in range(n_columns):
            runs[row, column] = n_columns - column
    spans = np.empty((1, 3), dtype=np.int32)
    best_spans = np.empty((1, 3), dtype=np.int32)
    for chart in order:
        least_top, n_best_spans = n_rows + 1, 0
        for item in range(4 * n_poses):
            pose, turn = item // 4, item % 4
            across, up = boxes[chart, pose, 0], boxes[chart, pose, 1]
            width, height = (across, up) if turn % 2 == 0 else (up, across)
            if width > n_columns or height >= least_top:
                continue
            start = starts[chart, pose]
            mask = masks[start : start + across * up].reshape(up, across)
            if len(spans) < across * up:
                spans = np.empty((across * up, 3), dtype=np.int32)
            n_spans = _spans_of(mask, turn, spans)
            x, y = _lowest_place(spans[:n_spans], width, height, runs, least_top)
            if y >= 0:
                least_top, n_best_spans = y + height, n_spans
                places[chart, 0], places[chart, 1] = x, y
                places[chart, 2], places[chart, 3] = pose, turn
                spans, best_spans = best_spans, spans
        if n_best_spans == 0:
            return False
        x, y = places[chart, 0], places[chart, 1]
        _block(best_spans[:n_best_spans], x, y, half_widths, blocked, runs)
    return True


@njit(nogil=True, cache=True)
def _spans_of(mask, turn, spans):  # type: ignore[no-untyped-def]
    """Write the runs of marked cells of a turned mask as (row, begin, end); return their number."""
    height, width = mask.shape
    n_rows, n_columns = (height, width) if turn % 2 == 0 else (width, height)
    count = 0
    for row in range(n_rows):
        begin = -1
        for column in range(n_columns + 1):
            marked = False
            if column < n_columns:
                if turn == 0:
                    marked = mask[row, column] != 0
                elif turn == 1:
                    marked = mask[height - 1 - column, row] != 0
                elif turn == 2:
                    marked = mask[height - 1 - row, width - 1 - column] != 0
                else:
                    marked = mask[column, width - 1 - row] != 0
            if marked and begin < 0:
                begin = column
            elif not marked and begin >= 0:
                spans[count, 0], spans[count, 1], spans[count, 2] = row, begin, column
                count += 1
                begin = -1
    return count


@njit(nogil=True, cache=True)
def _lowest_place(spans, width, height, runs, below):  # type: ignore[no-untyped-def]
    """Lowest, then leftmost place where all spans are free and the top is less than `below`."""
    n_rows, n_columns = runs.shape
    n_spans = len(spans)
    probe = 0  # the span that failed last is the likeliest to fail again
    for y in range(min(n_rows, below - 1) - height + 1):
        x, passed = 0, 0
        while passed < n_spans and x + width <= n_columns:
            row, begin, end = spans[probe, 0], spans[probe, 1], spans[probe, 2]
            run = runs[y + row, x + begin]
            if run >= end - begin:
                passed += 1
                probe = probe + 1 if probe + 1 < n_spans else 0
                continue
            # To the next free cell of that row, past whatever stands in the way.
            passed = 0
            if run > 0:
                x += run
                if x + begin >= n_columns:
                    x = n_columns
                    break
                run = runs[y + row, x + begin]
            x -= run
            if x + begin >= n_columns:
                break
        if passed == n_spans:
            return x, y
    return -1, -1


@njit(nogil=True, cache=True)
def _block(spans, x, y, half_widths, blocked, runs):  # type: ignore[no-untyped-def]
    """Block the cells near a chart that has been placed, and renew the runs of their rows."""
    n_rows, n_columns = runs.shape
    reach = len(half_widths) // 2
    for i in range(len(spans)):
        for step in range(-reach, reach + 1):
            row = y + spans[i, 0] + step
            if 0 <= row < n_rows:
                aside = half_widths[step + reach]
                begin = max(x + spans[i, 1] - aside, 0)
                end = min(x + spans[i, 2] + aside, n_columns)
                blocked[row, begin:end] = 1
    first = max(y + spans[0, 0] - reach, 0)
    last = min(y + spans[len(spans) - 1, 0] + reach, n_rows - 1)
    for row in range(first, last + 1):
        run = 0
        for column in range(n_columns - 1, -1, -1):
            if blocked[row, column]:
                run = run - 1 if run < 0 else -1
            else:
                run = run + 1 if run > 0 else 1
            runs[row, column] = run
