"""Charts packed into textures of exactly the requested size, as large as they fit.

Each chart is rasterized to the cells that it touches and placed at the lowest, then leftmost free
position, in the pose that ends lowest. Large charts come first, and small ones fill gaps and holes.
All charts have one scale, so that texels are square and the density is uniform; it is bisected
until a slightly larger one would no longer fit. With more effort, a search for denser packings
follows.

A cell is one texel, or a square of several if the texture is so large that single texels would cost
much and gain little. Distances are exact in texels either way, and never less than requested.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from texbake.errors import UnwrapError, counted
from texbake.mapping.atlas.neighbors import Neighbors
from texbake.mapping.atlas.packing.bins import Bins, enlarge, place_at_largest_scale, place_at_scale
from texbake.mapping.atlas.packing.bitmaps import Outlines, PackingGrid
from texbake.mapping.atlas.packing.nearness import nearer_layout
from texbake.mapping.atlas.packing.refine import FinalLayout, RoughLayout, refine_layout
from texbake.mapping.atlas.packing.search import (
    CoarseLayout,
    coarse_layout,
    squeeze_layout,
    with_neighbors_near,
)
from texbake.mapping.atlas.packing.strips import with_wide_strips
from texbake.mapping.corner_uvs import signed_areas
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

_MOST_CELLS = 1024  # cells along the longer side of the grid, for few charts
_CELLS_A_CHART = 12  # along the side of a chart, for many

# Charts that, along u or v, would be longer than the texture at this fill may have any angle.
_LEAST_FILL = 0.6
_MANY_CHARTS = 1024
_MOST_ORDERED = 256  # charts times orders that are tried
_MOST_ORDERS = {"fast": 3, "good": 32, "best": 32}
_FEW_ORDERS = 4  # that are tried after a search
_MOST_SEARCHED = 768  # charts; the work of a search grows with the square of their number
_MOST_COARSE = 300  # charts that a coarse grid represents well enough
# Areas of the grid that squares as wide as the charts are long may take in a search, which stores
# bitmaps of charts at any angle: they are larger only for hundreds of charts as long as the grid.
_MOST_SQUARES = 100


@dataclass(frozen=True, kw_only=True)
class _Budget:
    """Trials of each stage of a search, of which the best go on, and steps of work.

    `squeeze_work` is that of all trials together.
    """

    drafts: int
    squeezed: int
    settled: int
    draft_work: int
    squeeze_work: int
    refine_work: int
    least_share: float  # of the work, for meshes of few faces


_BUDGETS = {
    "good": _Budget(
        drafts=2, squeezed=3, settled=1,
        draft_work=20_000_000, squeeze_work=60_000_000, refine_work=50_000_000, least_share=0.4,
    ),
    "best": _Budget(
        drafts=8, squeezed=5, settled=4,
        draft_work=150_000_000, squeeze_work=1_250_000_000, refine_work=200_000_000,
        least_share=0.2,
    ),
}  # fmt: skip
# Steps of work per face besides, for the bitmaps of the scales that are tried.
_STEPS_TO_SCALE = 2000
# The whole budget is spent from this many texels, faces, and charts besides the first, on; with
# fewer there is less to gain, and who has a small mesh expects no wait.
_WHOLE_BUDGET = 1024 * 1024
_LEAST_SHARE = 0.5  # of the budget, however few the texels
_MANY_FACES = 4000
_MANY_TO_ARRANGE = 15

_LEAST_SCALE = 0.993  # of a squeezed layout with its neighbors near, as a share of the largest
# Steps of work to move neighbors near each other, per chart and per face, of so many at most.
_NEAR_WORK_A_CHART, _NEAR_WORK_A_FACE = 100_000, 250
_MOST_NEAR_CHARTS, _MOST_NEAR_FACES = 100, 100_000

_UDIM_COLUMNS = 10
_SLIGHT = 1e-6  # an advantage that could be rounding, as a share of the whole
_MOST_TILES = 1000  # of all groups together; each has a grid of cells in memory
_MOST_TILES_TOLD = 1000  # tried in order to say how many would be enough


@dataclass(frozen=True, kw_only=True, eq=False)
class Packing:
    """Packed charts."""

    # (T, 2) float64; texture coordinates; those of tile k lie in the unit square moved right by k %
    # 10 and up by k // 10, which is UDIM tile 1001 + k.
    uvs: FloatArray
    texels_per_unit: float  # texels per unit of the input coordinates
    fill: float  # area of the charts as a share of the used tiles
    tiles: IntArray  # (C,) int32; tile of each chart
    n_tiles: int  # tiles with charts on them
    reshaped: BoolArray  # (C,); charts that are no longer similar to the input


def pack_charts(
    uvs: FloatArray,
    faces: IntArray,
    chart_ids: IntArray,
    *,
    size: tuple[int, int],
    padding: int,
    name: str = "mesh",
    effort: str = "good",
    tiles: int = 1,
    tile_groups: IntArray | None = None,
    density: float | None = None,
    unit: float = 1.0,
    reshape: bool = False,
    neighbors: Neighbors | None = None,
    threads: int | None = None,
) -> Packing:
    """Rotate, scale and move charts so that they fill one or several textures.

    `uvs` (T, 2), one unit of which is `unit` model units; `chart_ids` (T,); `size`: columns and
    rows; `tiles`: textures, per group of `tile_groups` (C,); `density`: texels per model unit, None
    for the largest; `reshape`: widen thin strips; `neighbors`: charts to place near each other.
    """
    n_charts = int(chart_ids.max()) + 1
    charts = Outlines(
        uvs=uvs, faces=faces, chart_ids=chart_ids, n_charts=n_charts, neighbors=neighbors
    )
    groups = np.zeros(n_charts, dtype=np.int32) if tile_groups is None else tile_groups
    n_groups = int(groups.max()) + 1
    check_tiles(n_groups, tiles, name)
    scale = density * unit if density is not None else _least_scale(charts, size, tiles * n_groups)
    charts = charts.along_axes(max(size) / scale)
    reshaped = np.zeros(n_charts, dtype=np.bool_)
    if reshape and density is None:
        charts, reshaped = with_wide_strips(charts, size, padding, tiles * n_groups)
        if reshaped.any() and charts.neighbors is not None:  # strips have new directions
            charts = replace(charts, neighbors=charts.neighbors.without_pairs())
    grid = PackingGrid.over(size, padding, most_cells=_most_cells(size, n_charts))
    bins = Bins(charts, grid, groups, tiles)
    if grid.width <= 0 or grid.height <= 0:
        raise UnwrapError(_does_not_fit(bins, size, padding, name))
    n_orders = min(_MOST_ORDERED // n_charts, _MOST_ORDERS[effort])
    searched = (
        effort != "fast"
        and density is None
        and tiles == 1
        and not groups.any()
        and 1 < n_charts <= _MOST_SEARCHED
        and bool(bins.areas.sum() > 0.0)
        and _squares(bins) <= _MOST_SQUARES
    )
    found = _searched(bins, size, padding, effort, threads) if searched else None
    if found is not None:
        bins.found, bins.tiles = found, np.zeros(n_charts, dtype=np.int32)
        # Strips with faces narrower than a texel own more texels if they are at an angle.
        if not reshaped.any():
            enlarge(bins, found.scale, range(min(n_orders, _FEW_ORDERS)))
    elif density is not None:
        if not place_at_scale(bins, density * unit / grid.cell, n_orders):
            raise UnwrapError(_does_not_fit_at(bins, density, unit, size, padding, name))
    elif not place_at_largest_scale(bins, n_orders):
        raise UnwrapError(_does_not_fit(bins, size, padding, name))
    if charts.neighbors is not None:
        bins.found = nearer_layout(bins.found, bins.tiles, grid, _near_work(charts))
    return _packed(bins, size, padding, reshaped)


def upright_tiles(
    packing: Packing, chart_ids: IntArray, faces: IntArray, heights: FloatArray, *, square: bool
) -> FloatArray:
    """(T, 2) coordinates, with each tile turned so that world up is up for most of its area.

    `heights` (F, 3): of corners in space. A half turn is always free, a quarter turn if `square`.
    """
    corners = packing.uvs[faces]
    (x1, y1), (x2, y2) = (corners[:, i].T - corners[:, 0].T for i in (1, 2))
    rise1, rise2 = (heights[:, i] - heights[:, 0] for i in (1, 2))
    # Gradient of the height in the texture, times twice the area.
    along, up = rise1 * y2 - rise2 * y1, rise2 * x1 - rise1 * x2
    owners, tile_of = packing.tiles[chart_ids[faces[:, 0]]], packing.tiles[chart_ids]
    uvs = packing.uvs.copy()
    for tile in np.unique(owners):
        own, moved = owners == tile, tile_of == tile
        x, y = float(along[own].sum()), float(up[own].sum())
        rows = [(y, 0), (x, 1), (-y, 2), (-x, 3)][:: 1 if square else 2]
        slight = _SLIGHT * float((np.abs(along[own]) + np.abs(up[own])).sum())
        turns = max(rows, key=lambda row: row[0] - slight * row[1])[1]
        first = np.array([tile % _UDIM_COLUMNS, tile // _UDIM_COLUMNS])
        u, v = (uvs[moved] - first).T
        turned = [(u, v), (1.0 - v, u), (1.0 - u, 1.0 - v), (v, 1.0 - u)][turns]
        uvs[moved] = np.stack(turned, axis=1) + first
    return uvs


def check_tiles(n_groups: int, tiles: int, name: str) -> None:
    """Raise `UnwrapError` if groups with tiles of their own need too many tiles."""
    wanted = n_groups * tiles
    if wanted > _MOST_TILES:
        raise UnwrapError(
            f"{name}: {tiles:,} tiles for each of {n_groups:,} groups are {wanted:,} tiles, more "
            f"than {_MOST_TILES:,}; use fewer tiles, or let groups share them"
        )


def _packed(bins: Bins, size: tuple[int, int], padding: int, reshaped: BoolArray) -> Packing:
    """Turn cells into texture coordinates."""
    charts, found, cell = bins.charts, bins.found, bins.grid.cell
    uvs = (found.uvs() * cell + padding) / np.array(size, dtype=np.float64)
    area = float(np.abs(signed_areas(uvs[charts.faces])).sum())
    n_tiles = len(np.unique(bins.tiles))
    offsets = np.stack([bins.tiles % _UDIM_COLUMNS, bins.tiles // _UDIM_COLUMNS], axis=1)
    return Packing(
        uvs=uvs + offsets[charts.chart_ids],
        texels_per_unit=found.scale * cell,
        fill=area / n_tiles,
        tiles=bins.tiles,
        n_tiles=n_tiles,
        reshaped=reshaped,
    )


def _searched(
    bins: Bins, size: tuple[int, int], padding: int, effort: str, threads: int | None
) -> FinalLayout | None:
    """Return the densest packing that a search finds; None if it finds none."""
    budget, charts = _BUDGETS[effort], bins.charts
    texels, others = size[0] * size[1], charts.n_charts - 1
    share = min(max(texels / _WHOLE_BUDGET, _LEAST_SHARE), 1.0)
    share *= min(others / _MANY_TO_ARRANGE, 1.0)
    share *= min(max(len(charts.faces) / _MANY_FACES, budget.least_share), 1.0)
    scaling_work = _STEPS_TO_SCALE * len(charts.faces)
    layouts: list[RoughLayout]
    if charts.n_charts <= _MOST_COARSE:
        work = int(budget.draft_work * share) + scaling_work
        drafts = _best(
            lambda seed: coarse_layout(charts, size, padding, most_work=work, seed=seed),
            range(budget.drafts),
            threads,
        )
        drafts = _with_neighbors(drafts, charts, budget.squeezed, threads)
        work = int(budget.squeeze_work * share) // max(len(drafts), 1)
        layouts = _best(
            lambda draft: squeeze_layout(draft, most_work=work, seed=0), drafts, threads
        )
        layouts = [each for each in layouts if each.scale >= _LEAST_SCALE * layouts[0].scale]
        layouts.sort(key=lambda layout: -layout.value)
    elif place_at_largest_scale(bins, 0):
        layouts = [bins.found.layout(bins.grid, bins.angles)]
    else:
        return None
    work = int(budget.refine_work * share) + scaling_work
    settled = _best(
        lambda layout: refine_layout(charts, layout, bins.grid, most_work=work, seed=0),
        layouts[: budget.settled],
        threads,
    )
    return settled[0] if settled else None


def _with_neighbors(
    drafts: list[CoarseLayout], charts: Outlines, most: int, threads: int | None
) -> list[CoarseLayout]:
    """The best draft as it is, which may fill most, and the best with their neighbors near."""
    if charts.neighbors is None:
        return drafts[:most]
    work = _near_work(charts) // 2
    return drafts[:1] + _best(
        lambda draft: with_neighbors_near(draft, work), drafts[: most - 1], threads
    )


def _best(find: Callable[[Any], Any], items: Sequence[Any], threads: int | None) -> list[Any]:
    """Results for all items, those of the largest scale first; without None."""
    results: list[Any] = [None] * len(items)

    def run(index: int, _: int) -> None:
        results[index] = find(items[index])

    run_bands(run, len(items), band=1, threads=threads)
    # Equally good ones stay in order, whichever was finished first.
    return sorted(filter(None, results), key=lambda result: -result.scale)


def _least_scale(charts: Outlines, size: tuple[int, int], n_tiles: int) -> float:
    """Texels per unit at which charts fill the tiles as far as they should at least."""
    texels = _LEAST_FILL * size[0] * size[1] * n_tiles
    return math.sqrt(texels / (float(charts.areas.sum()) or 1.0))


def _near_work(charts: Outlines) -> int:
    """Steps of work to move neighbors near each other."""
    of_charts = _NEAR_WORK_A_CHART * min(charts.n_charts, _MOST_NEAR_CHARTS)
    return of_charts + _NEAR_WORK_A_FACE * min(len(charts.faces), _MOST_NEAR_FACES)


def _squares(bins: Bins) -> float:
    """Most area of squares as wide as the charts are long, in areas of the grid."""
    cells = bins.grid.width * bins.grid.height
    longest = max(bins.grid.width, bins.grid.height)
    scale = min(math.sqrt(cells / bins.areas.sum()), longest / bins.lengths.max())
    return float(((bins.lengths * scale) ** 2).sum()) / cells


def _most_cells(size: tuple[int, int], n_charts: int) -> int:
    """Cells along the longer side of the grid: enough to represent the charts."""
    side = math.sqrt(size[0] * size[1] / n_charts)
    finest = max(int(side / _CELLS_A_CHART), 1)
    return max(_MOST_CELLS, max(size) // finest) if n_charts > _MANY_CHARTS else _MOST_CELLS


def _does_not_fit(bins: Bins, size: tuple[int, int], padding: int, name: str) -> str:
    """Say that there are too many charts for the texels."""
    room = f"{size[0]} x {size[1]} texels"
    if bins.n_tiles > 1:
        room = f"{bins.n_tiles} tiles of {room}"
    return (
        f"{name}: {counted(bins.charts.n_charts, 'chart does', 'charts do')} not fit into {room} "
        f"with a padding of {padding}; use a larger size or less padding"
    )


def _does_not_fit_at(
    bins: Bins, density: float, unit: float, size: tuple[int, int], padding: int, name: str
) -> str:
    """Say why the charts do not fit at a density, and what to do."""
    scale = density * unit / bins.grid.cell
    for group in np.unique(bins.groups):
        needed = bins.tiles_needed(scale, int(group), _MOST_TILES_TOLD)
        if needed is None:
            longest = float(bins.lengths.max()) * density * unit
            return (
                f"{name}: at {density:g} texels per unit a chart is {longest:.0f} texels long and "
                f"does not fit into {size[0]} x {size[1]} with a padding of {padding}; use a "
                f"size of {math.ceil(longest) + 2 * padding + 2} or more, or a lower texel density"
            )
        if needed > bins.n_tiles:
            enough = density * math.sqrt(bins.n_tiles / needed)
            few = needed <= _MOST_TILES_TOLD
            return (
                f"{name}: at {density:g} texels per unit the charts need "
                f"{needed if few else f'more than {_MOST_TILES_TOLD}'} tiles of "
                f"{size[0]} x {size[1]}, not {bins.n_tiles}; allow more with `tiles`, or use a "
                f"larger size or a texel density of about {enough:.3g}"
            )
    raise AssertionError("they fit")
