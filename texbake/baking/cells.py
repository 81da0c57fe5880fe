"""Texels divided into quarters, and those again, where samples beside each other disagree.

A cell of level k is a square of which 4^k make a texel. It has one sample: at its center, or, where
it is covered in part, at the covered sub-square nearest to the middle of all of these, so that a
value that changes evenly is exact there too. Cells of level 0 are the texels, all of them; a cell
that is divided has four children on the next level. A texel that is sure to need it is divided
twice at once: its cells of level 1 have no samples.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980: samples are added where those at hand disagree. Departs from it by samples at the
middles of cells, which are exact where values change evenly, and by a bound for the whole texel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.cell_samples import submask
from texbake.baking.coverage import FINE, FULL, Coverage
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

LAST_LEVEL = 3  # 64 cells a texel
NO_CHART = -1
NO_CHILD = -1
TILE = 8  # texels a side whose cells lie together, so that their rays do

FloatArray32 = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Level:
    """Where the cells of one level lie; those of one parent, and of one texel, lie together.

    Attributes
    ----------
    first : int
        Place of the first among all cells; the others follow.
    texels : (n,) int32
        Row times width plus column.
    spots : (n,) uint8
        `FINE` times row plus column of the cell within its texel.
    weights : (n,) uint8
        How many sub-squares of it are covered.
    """

    first: int
    texels: IntArray
    spots: npt.NDArray[np.uint8]
    weights: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.texels)


class Cells:
    """All cells: the texels, each at its own place, then one level after another.

    Attributes
    ----------
    values : (n, C) float32
        The samples' values, of all maps beside each other.
    charts : (n,) int32
        Chart of the light mesh that the sample lies in, `NO_CHART` where it has no value.
    children : (n,) int32
        Place of the first of four children, `NO_CHILD` for none.
    levels : list of Level
        From level 1 on.
    """

    def __init__(self, n_texels: int, n_channels: int) -> None:
        # Pages that nothing is written to cost nothing, so there is room for many levels.
        n_room = 4 * n_texels + 1024
        self._n = n_texels
        self.values = np.empty((n_room, n_channels), dtype=np.float32)
        self.charts = np.empty(n_room, dtype=np.int32)
        self.children = np.empty(n_room, dtype=np.int32)
        self.charts[:n_texels] = NO_CHART
        self.children[:n_texels] = NO_CHILD
        self.levels: list[Level] = []

    def add(self, divided: IntArray, coverage: Coverage) -> Level:
        """Divide some cells of the last level, given by their places, into four each."""
        first, n = self._n, 4 * len(divided)
        self._make_room(first + n)
        new = slice(first, first + n)
        self.charts[new] = NO_CHART
        self.children[new] = NO_CHILD
        level = Level(
            first,
            np.empty(n, dtype=np.int32),
            np.empty(n, dtype=np.uint8),
            np.empty(n, dtype=np.uint8),
        )
        k, parents = len(self.levels) + 1, self.levels[-1] if self.levels else None
        texels = divided if parents is None else parents.texels[divided - parents.first]
        spots = (
            np.zeros(len(divided), dtype=np.uint8)
            if parents is None
            else parents.spots[divided - parents.first]
        )
        _children_kernel(
            (k, first), (divided, texels, spots), (coverage.counts, coverage.masks),
            self.children, (level.texels, level.spots, level.weights),
        )  # fmt: skip
        self.levels.append(level)
        self._n = first + n
        return level

    def _make_room(self, n: int) -> None:
        if n <= len(self.charts):
            return
        n_room = max(n, 2 * len(self.charts))
        for name in ("values", "charts", "children"):
            old = getattr(self, name)
            new = np.empty((n_room, *old.shape[1:]), dtype=old.dtype)
            new[: self._n] = old[: self._n]
            setattr(self, name, new)

    def keep(
        self, places: IntArray, charts: IntArray, values: FloatArray32, first_channel: int,
        threads: int | None,
    ) -> None:  # fmt: skip
        """Write values of some cells' samples, of one map, from `first_channel` on."""

        def keep(start: int, stop: int) -> None:
            _keep_kernel(
                places[start:stop], charts[start:stop], values[start:stop], first_channel,
                self.charts, self.values,
            )  # fmt: skip

        run_bands(keep, len(places), band=1 << 16, threads=threads)

    def firsts(self, n_texels: int, channels: slice) -> FloatArray32:
        """(n_texels, C): the value of the first sample of each texel that hit, 0 without any."""
        values = np.zeros((n_texels, channels.stop - channels.start), dtype=np.float32)
        is_set = self.charts[:n_texels] != NO_CHART
        values[is_set] = self.values[:n_texels][is_set, channels]
        for level in self.levels:
            has_value = self.charts[level.first : level.first + len(level)] != NO_CHART
            new = np.flatnonzero(has_value & ~is_set[level.texels])
            texels = level.texels[new]
            values[texels[::-1]] = self.values[level.first + new[::-1], channels]
            is_set[texels] = True
        return values


def in_tiles(chosen: BoolArray, n_chosen: int) -> IntArray:
    """Ids of those texels (height, width) that are chosen, tile by tile."""
    ids = np.empty(n_chosen, dtype=np.int32)
    _tiles_kernel(chosen, ids)
    return ids


def gather(cells: Cells, level: Level, sums: FloatArray32, areas: FloatArray32) -> None:
    """Add the values of a level's undivided cells to the sums (n_texels, C), by what they cover."""
    _gather_kernel(
        level.first, level.texels, level.weights,
        (cells.children, cells.charts, cells.values), sums, areas,
    )  # fmt: skip


@kernel
def _children_kernel(size, parents, coverage, children, new):  # type: ignore[no-untyped-def]
    level, first = size
    places, parent_texels, parent_spots = parents
    counts, masks = coverage
    texels, spots, weights = new
    whole = FULL >> (2 * level)
    for i in range(len(places)):
        children[places[i]] = first + 4 * i
        texel = parent_texels[i]
        row, column = parent_spots[i] // FINE, parent_spots[i] % FINE
        for child in range(4):
            spot = (2 * row + child // 2) * FINE + 2 * column + child % 2
            texels[4 * i + child] = texel
            spots[4 * i + child] = spot
            if counts[texel] == FULL:
                weights[4 * i + child] = whole
            else:
                weights[4 * i + child] = submask(masks, texel, level, spot)[0]


@kernel
def _tiles_kernel(chosen, ids):  # type: ignore[no-untyped-def]
    height, width = chosen.shape
    n = 0
    for top in range(0, height, TILE):
        for left in range(0, width, TILE):
            for row in range(top, min(top + TILE, height)):
                for column in range(left, min(left + TILE, width)):
                    if chosen[row, column]:
                        ids[n] = row * width + column
                        n += 1


@kernel
def _keep_kernel(places, charts, values, first_channel, kept_charts, kept):  # type: ignore[no-untyped-def]
    for i in range(len(places)):
        kept_charts[places[i]] = charts[i]
        for channel in range(values.shape[1]):
            kept[places[i], first_channel + channel] = values[i, channel]


@kernel
def _gather_kernel(first, texels, weights, cells, sums, areas):  # type: ignore[no-untyped-def]
    children, charts, values = cells
    for i in range(len(texels)):
        place = first + i
        if children[place] != NO_CHILD or charts[place] == NO_CHART:
            continue
        area = np.float32(weights[i])
        areas[texels[i]] += area
        for channel in range(values.shape[1]):
            sums[texels[i], channel] += area * values[place, channel]
