"""Charts placed in the tiles of their groups, at a given scale or the largest at which they fit.

Charts are placed one after another, large ones first, each where its top ends lowest.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.packing.bitmaps import Bitmaps, Outlines, PackingGrid
from texbake.mapping.atlas.packing.refine import SNAP_MARGIN, FinalLayout
from texbake.mesh.mesh import IntArray

_FIRST_GUESS = 0.6  # share of the texture that is filled
_SCALE_GROWTH = 1.08
_SCALE_STEP = 0.004  # relative; one texel in 250

# For thousands of charts, which make each trial slow:
_LOW_GUESS = 0.5
_ROUGH_STEP = 0.01

# Few charts are tried in many poses, many charts in few poses, which bounds the work.
_MOST_POSED = 256
_MOST_POSES = 4
_MANY_CHARTS = (1024, 8192)  # above which placing hurries, and hurries even more

_GOLDEN_RATIO = 0.6180339887498949  # its multiples, modulo 1, are spread evenly


class Bins:
    """Charts placed one after another in the tiles of their groups, at any number of scales.

    `found`: places at the last scale that fit, in `tiles` (C,); `room_above`: factor by which
    charts could grow into free rows of the last tile; `sizes`, `lengths` (C,): of least bounding
    boxes.
    """

    found: FinalLayout
    tiles: IntArray
    room_above: float

    def __init__(self, charts: Outlines, grid: PackingGrid, groups: IntArray, n_tiles: int) -> None:
        self.charts, self.grid, self.groups, self.n_tiles = charts, grid, groups, n_tiles
        self.hurry = sum(charts.n_charts > many for many in _MANY_CHARTS)
        n_poses = min(max(_MOST_POSED // charts.n_charts, 1), _MOST_POSES)
        turns = np.arange(n_poses) * (math.pi / 2.0 / n_poses)
        self.angles = charts.allowed(turns)
        self.poses = charts.turned(self.angles)
        self.areas = charts.areas
        # Half the perimeter, by which xatlas sorts too.
        self.sizes = self.poses.extents[:, 0].sum(axis=1)
        self.lengths = self.poses.lengths()

    def order(self, trial: int) -> IntArray:
        """(C,) int32: charts by size, the largest first; from trial 1 on, slightly shuffled."""
        ids = np.arange(self.charts.n_charts)
        noise = (_GOLDEN_RATIO * (trial * len(ids) + ids)) % 1.0 - 0.5 if trial > 0 else 0.0
        return np.argsort(-self.sizes * pm.exp(noise), kind="stable").astype(np.int32)

    def try_scale(self, scale: float, trial: int = 0) -> bool:
        """Place all charts at a scale, in cells per unit; return whether they fit."""
        if not self._may_fit(scale):
            return False
        bitmaps = self.poses.bitmaps(scale, SNAP_MARGIN / self.grid.cell)
        places = np.full((self.charts.n_charts, 4), -1, dtype=np.int32)
        tiles = np.full(self.charts.n_charts, -1, dtype=np.int32)
        room_above = math.inf
        everything = self.order(trial)
        for group in np.unique(self.groups):
            order = everything[self.groups[everything] == group]
            n_tiles, top = self._fill(bitmaps, order, places, tiles, self.n_tiles)
            if n_tiles is None or n_tiles > self.n_tiles:
                return False
            if n_tiles == self.n_tiles:
                room_above = min(room_above, math.sqrt(self.grid.height / top))
            tiles[order] += group * self.n_tiles
        self.room_above = room_above
        self.found = FinalLayout(poses=self.poses, bitmaps=bitmaps, places=places, scale=scale)
        self.tiles = tiles
        return True

    def tiles_needed(self, scale: float, group: int, most: int) -> int | None:
        """Tiles that a group needs at a scale; `most + 1` if more, None if a chart fits in none."""
        if (self.lengths * scale > self._longest).any():
            return None
        bitmaps = self.poses.bitmaps(scale, SNAP_MARGIN / self.grid.cell)
        n_charts = self.charts.n_charts
        places, tiles = (np.empty(shape, dtype=np.int32) for shape in ((n_charts, 4), n_charts))
        order = self.order(0)
        order = order[self.groups[order] == group]
        return self._fill(bitmaps, order, places, tiles, most)[0]

    @property
    def _longest(self) -> int:
        return max(self.grid.width, self.grid.height)

    def _may_fit(self, scale: float) -> bool:
        """Whether no chart is longer than the grid, nor all together larger than the tiles."""
        if (self.lengths * scale > self._longest).any():
            return False
        areas = np.bincount(self.groups, np.maximum(self.areas * scale**2, self.lengths * scale))
        return bool((areas <= self.n_tiles * self.grid.width * self.grid.height).all())

    def _fill(
        self, bitmaps: Bitmaps, order: IntArray, places: IntArray, tiles: IntArray, most: int
    ) -> tuple[int | None, int]:
        """Place charts in the first tile with room; return tiles (None if none fits), top row."""
        for tile in range(most):
            last = tile == most - 1
            found, tops, n_missing = place_charts(
                bitmaps, order, self.grid, all_or_nothing=last, hurry=self.hurry
            )
            here = order[found[order, 0] >= 0]
            places[here], tiles[here] = found[here], tile
            if n_missing == 0:
                return tile + 1, int(tops.max())
            if len(here) == 0 and not last:
                return None, 0
            order = order[found[order, 0] < 0]
        return most + 1, 0


def place_at_scale(bins: Bins, scale: float, n_orders: int) -> bool:
    """Place charts in as few tiles as several orders achieve; return whether they fit at all."""
    best: tuple[FinalLayout, IntArray] | None = None
    shares = np.bincount(bins.groups, bins.areas) * scale**2 / (bins.grid.width * bins.grid.height)
    fewest = int(np.maximum(np.ceil(shares[np.bincount(bins.groups) > 0]), 1).sum())
    for trial in range(n_orders + 1):
        if bins.try_scale(scale, trial):
            n_tiles = len(np.unique(bins.tiles))
            if best is None or n_tiles < len(np.unique(best[1])):
                best = bins.found, bins.tiles
            if n_tiles <= fewest:
                break
    if best is not None:
        bins.found, bins.tiles = best
    return best is not None


def place_at_largest_scale(bins: Bins, n_orders: int) -> bool:
    """Place charts at the largest scale at which they fit; return whether there is one."""
    n_cells = bins.grid.width * bins.grid.height
    if (np.bincount(bins.groups) > n_cells * bins.n_tiles).any():
        return False
    largest = float(np.bincount(bins.groups, bins.areas).max())
    if largest <= 0.0:
        return bins.try_scale(1.0)
    longest = float(bins.sizes.max())
    fits, too_large = 0.0, 2.0 * max(bins.grid.width, bins.grid.height) / longest
    many = bins.hurry > 0
    first_guess, precision = (_LOW_GUESS, _ROUGH_STEP) if many else (_FIRST_GUESS, _SCALE_STEP)
    scale = min(math.sqrt(first_guess * n_cells * bins.n_tiles / largest), too_large)
    if bins.hurry > 1:
        scale = min(_guess_with_padding(bins, first_guess), scale)
    step, share = _SCALE_GROWTH, 0.0
    while too_large - fits > precision * too_large:
        if bins.try_scale(scale):
            # The free rows above the charts show how much larger they can be.
            step = min(max(bins.room_above, 1.0 + precision), _SCALE_GROWTH) if many else step
            larger = scale * step
            if bins.hurry > 1:
                before, share = share, 1.0 / bins.room_above
                growth = (1.0 - share) * (scale - fits) / max(share - before, 1e-6)
                larger = min(max(scale + growth, scale * (1.0 + precision)), 2.0 * scale)
            fits = scale
            if bins.hurry > 1 and bins.room_above < 1.0 + precision:
                break
            scale = min(larger, (fits + too_large) / 2.0)
        else:
            too_large = scale
            scale = max(scale / step, (fits + too_large) / 2.0)
            step *= step  # shrinks ever faster until the charts fit
        if too_large * longest < 0.01:  # too many charts, even at one cell each
            return False
    enlarge(bins, fits, range(1, n_orders + 1))
    return True


def enlarge(bins: Bins, scale: float, trials: range) -> None:
    """Place charts at larger scales than one that fits, while slightly different orders allow."""
    for trial in trials:
        step = _SCALE_STEP
        while True:
            if bins.try_scale(scale * (1.0 + step), trial):
                scale, step = scale * (1.0 + step), 2.0 * step
            elif step > _SCALE_STEP:
                step = _SCALE_STEP
            else:
                break


def _guess_with_padding(bins: Bins, share: float) -> float:
    """Scale at which charts, as squares with padding between them, fill a share of the tiles."""
    gap = float(len(bins.grid.half_widths) // 2)
    padding = len(bins.areas) * gap**2
    n_cells = bins.grid.width * bins.grid.height * bins.n_tiles
    room = max(share * n_cells - padding, share * max(n_cells - padding, 1.0) / 2.0)
    squared, linear = float(bins.areas.sum()), gap * float(np.sqrt(bins.areas).sum())
    return room / (linear + math.sqrt(linear**2 + squared * room))


def place_charts(
    bitmaps: Bitmaps,
    order: IntArray,
    grid: PackingGrid,
    *,
    all_or_nothing: bool = True,
    hurry: int = 0,
) -> tuple[IntArray, IntArray, int]:
    """Place charts in `order` where their tops are lowest, in any pose and quarter turn.

    `hurry`: 1 starts where the last chart of about that size is, 2 is coarser and tries two turns.
    Returns `places` (C, 4) int32: column, row, pose and turns, or -1; `tops` (C,) int32; and the
    number of charts without a place. Kernel: `core/bottom_left.c`.
    """
    places = np.full((len(bitmaps.boxes), 4), -1, dtype=np.int32)
    tops = np.zeros(len(places), dtype=np.int32)
    n_missing = core.place_charts(
        bitmaps.masks, bitmaps.starts, bitmaps.boxes, order, grid.height, grid.width,
        grid.half_widths, all_or_nothing, hurry, places, tops,
    )  # fmt: skip
    return places, tops, n_missing
