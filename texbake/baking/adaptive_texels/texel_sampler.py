"""Texels divided into quarters recursively: where their samples lie, and how they are cast.

Cells of level 0 are the texels, all of them; a cell that is divided has four children on the next
level. Each cell has one sample, where `core/quadtree.c` puts it. A texel that is certain to need it
is divided twice at once, and its cells of level 1 have no samples.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980. Departs from it by samples at the middles of cells, which are exact where values change
evenly, and by one bound for the whole texel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from texbake.baking.adaptive_texels.coverage import (
    FULL,
    FaceBins,
    SampledCells,
    TexelCoverage,
    cell_samples,
    outlined_texels,
)
from texbake.baking.maps import MapKind
from texbake.baking.report import DistanceSummary
from texbake.baking.texels import NO_FACE, SampleGrid, Samples, owned_bands
from texbake.baking.trace import Trace
from texbake.core import core
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

NO_CHART = -1
NO_CHILD = -1
LAST_LEVEL = 3  # 64 cells per texel


@dataclass(frozen=True, eq=False)
class Level:
    """The cells of one level; those of one parent, and those of one texel, are adjacent."""

    first: int  # place of the first one among all cells; the others follow
    texels: IntArray  # (n,) int32; row times width plus column
    # (n,) uint8; `FINE` times row plus column of the cell within its texel.
    spots: ByteArray
    weights: ByteArray  # (n,) uint8; how many of its sub-squares are covered
    # Each (n,) int32; place of the same cell in each earlier division whose samples are reused,
    # `NO_CHILD` for none.
    origins: list[IntArray]

    def __len__(self) -> int:
        return len(self.texels)


@dataclass(frozen=True, eq=False)
class Division:
    """How the texels are divided: the levels of cells, and the first child of each texel."""

    levels: list[Level]
    children: IntArray


class Cells:
    """All cells: texels by their ids, then level by level; new divisions reuse their samples."""

    def __init__(self, n_texels: int, n_channels: int) -> None:
        # Memory that is never written to costs nothing, so this leaves room for many levels.
        n_room = 4 * n_texels + 1024
        self._n = self._n_texels = n_texels
        # Values of the samples, of all maps side by side; the chart that each lies in, `NO_CHART`
        # where there is no value; the place of the first of four children, `NO_CHILD` for none; and
        # whether the sample was cast, also if it hit nothing.
        self.values = np.empty((n_room, n_channels), dtype=np.float32)
        self.charts = np.empty(n_room, dtype=np.int32)
        self.children = np.empty(n_room, dtype=np.int32)
        self.is_cast = np.zeros(n_room, dtype=np.bool_)
        self.charts[:n_texels] = NO_CHART
        self.children[:n_texels] = NO_CHILD
        self.levels: list[Level] = []  # from level 1 on
        self._sources: list[Division] = []

    @property
    def division(self) -> Division:
        """How the texels are divided now."""
        return Division(self.levels, self.children[: self._n_texels].copy())

    def restart(self, sources: list[Division]) -> None:
        """Begin a new division of the texels, which takes over samples from earlier ones."""
        self._sources = sources
        self.children[: self._n_texels] = NO_CHILD
        self.levels = []

    def restore(self, division: Division) -> None:
        """Return to an earlier division."""
        self.levels = division.levels
        self.children[: self._n_texels] = division.children

    def add(self, divided: IntArray, coverage: TexelCoverage) -> Level:
        """Divide some cells of the last level, given by their places, into four children each."""
        first, n = self._n, 4 * len(divided)
        self._make_room(first + n)
        new = slice(first, first + n)
        self.charts[new] = NO_CHART
        self.children[new] = NO_CHILD
        self.is_cast[new] = False
        level = Level(
            first,
            np.empty(n, dtype=np.int32),
            np.empty(n, dtype=np.uint8),
            np.empty(n, dtype=np.uint8),
            [self._origins_of(divided, source) for source in range(len(self._sources))],
        )
        k, parents = len(self.levels) + 1, self.levels[-1] if self.levels else None
        texels = divided if parents is None else parents.texels[divided - parents.first]
        spots = (
            np.zeros(len(divided), dtype=np.uint8)
            if parents is None
            else parents.spots[divided - parents.first]
        )
        core.write_children(
            k, first, divided, texels, spots, *coverage,
            self.children, level.texels, level.spots, level.weights,
        )  # fmt: skip
        self.levels.append(level)
        self._n = first + n
        return level

    def _make_room(self, n: int) -> None:
        if n <= len(self.charts):
            return
        n_room = max(n, 2 * len(self.charts))
        for name in ("values", "charts", "children", "is_cast"):
            old = getattr(self, name)
            new = np.empty((n_room, *old.shape[1:]), dtype=old.dtype)
            new[: self._n] = old[: self._n]
            setattr(self, name, new)

    def _origins_of(self, divided: IntArray, source: int) -> IntArray:
        """Places that the children of some cells have in an earlier division, or `NO_CHILD`."""
        if self.levels:
            parents = self.levels[-1].origins[source][divided - self.levels[-1].first]
            firsts = np.where(parents == NO_CHILD, np.int32(NO_CHILD), self.children[parents])
        else:
            firsts = self._sources[source].children[divided]
        places = firsts[:, np.newaxis] + np.arange(4, dtype=np.int32)
        places[firsts == NO_CHILD] = NO_CHILD
        return np.asarray(places.reshape(-1), dtype=np.int32)

    def take_over(self, level: Level, cells: IntArray) -> IntArray:
        """Return cells without earlier samples, moved to the front, by `core/quadtree.c`."""
        for origins in level.origins:
            n_left = core.take_over_samples(
                origins, level.first, cells, self.is_cast, self.charts, self.values
            )
            cells = cells[:n_left]
        return cells

    def keep(
        self, places: IntArray, charts: IntArray, values: Float32Array, first_channel: int,
        threads: int | None,
    ) -> None:  # fmt: skip
        """Keep the values of some cells of one map, whose channels begin at `first_channel`."""

        def keep(start: int, stop: int) -> None:
            core.keep_values(
                places[start:stop], charts[start:stop], values[start:stop], first_channel,
                self.charts, self.values,
            )  # fmt: skip

        run_bands(keep, len(places), band=1 << 16, threads=threads)

    def firsts(self, n_texels: int, channels: slice) -> Float32Array:
        """(n_texels, C) float32: value of the first sample of each texel that hit, or 0."""
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


def in_tiles(chosen: BoolArray) -> IntArray:
    """Return the ids of the chosen texels, given as (height, width) bool, tile by tile."""
    ids = np.empty(int(np.count_nonzero(chosen)), dtype=np.int32)
    core.list_in_tiles(chosen, ids)
    return ids


# So few that what one step writes is still in the cache when the next one reads it.
_SAMPLES_AT_ONCE = 1 << 18


class TexelSampler:
    """Casts the samples of a trace."""

    def __init__(self, trace: Trace, distances: DistanceSummary) -> None:
        self.trace, self._distances = trace, distances
        self.kinds, self.inputs = trace.setup.kinds, trace.setup.inputs
        self.stages, self.threads = trace.stages, trace.options.threads
        self.shape: tuple[int, int] = trace.texel_faces.shape  # height and width of the map
        n_texels = trace.texel_faces.size
        self.coverage = TexelCoverage.none(n_texels)
        self.cells = Cells(n_texels, sum(kind.channels for kind in self.kinds))
        with self.stages.part("prepare low-poly mesh"):
            self.bins = FaceBins.of(trace.low, self.shape[1], self.shape[0])
        # Called between parts of the work, with the share of it that is done and the number of
        # cells of this level that are left; it may raise an error to end the work.
        self.watch: Callable[[float, int], None] | None = None

    def channels(self) -> Iterator[tuple[MapKind, slice]]:
        """Yield each map with its columns among the values."""
        first = 0
        for kind in self.kinds:
            yield kind, slice(first, first + kind.channels)
            first += kind.channels

    def cast_texels(self) -> None:
        """Cast the first sample of each texel, and measure how much of it is covered."""
        height, width = self.shape
        grid = SampleGrid(width, height, 1)
        with self.stages.part("rasterize"):
            outlined = outlined_texels(self.bins, width, height)
        partly: list[IntArray] = []  # texels that are not sampled at their center

        def measure(owners: IntArray, rows: range) -> None:
            self.trace.texel_faces[rows.start : rows.stop] = owners
            self.coverage.measure(self.bins, owners, outlined, rows, self.threads)
            partly.append(self._without_parts(owners, rows))

        for band in owned_bands(
            self.trace.snap(grid),
            grid,
            self.stages,
            samples_at_once=_SAMPLES_AT_ONCE,
            edit=measure,
            threads=self.threads,
        ):
            self.trace.counts.samples_overlapping += band.n_overlaps
            self._cast(band.samples.texel_ids, band.samples, 0)
            if self.watch is not None:
                self.watch(band.rows.stop / height, 0)
        with self.stages.stage("bake outlines", recorded=False):
            with self.stages.part("rasterize"):
                texels = np.concatenate(partly)
                no_spots = np.zeros(len(texels), dtype=np.uint8)
                places, samples = self._samples(0, (texels, texels, no_spots))
            self._cast(places, samples, 0)

    def _without_parts(self, owners: IntArray, rows: range) -> IntArray:
        """Remove the owners of texels that are not sampled at their center; return these texels."""
        first = rows.start * self.shape[1]
        counts = self.coverage.counts[first : first + owners.size].reshape(owners.shape)
        is_part = (counts > 0) & ((counts < FULL) | (owners == NO_FACE))
        # A texel of which only the center is covered is sampled there.
        masks = self.coverage.masks[first : first + owners.size].reshape(owners.shape)
        is_part &= masks != 0
        owners[is_part] = NO_FACE
        return in_tiles(is_part) + np.int32(first)

    def divide(self, places: IntArray, is_cast: BoolArray | None = None) -> Level:
        """Divide some cells of the last level and cast their children, or some of these."""
        level = self.cells.add(places, self.coverage)
        k = len(self.cells.levels)
        chosen = level.weights > 0
        if is_cast is not None:
            chosen &= is_cast
        cells = self.cells.take_over(level, np.flatnonzero(chosen).astype(np.int32))
        name = f"bake {1 << k} x {1 << k}"
        with self.stages.stage(name, total=len(cells), unit="cells", recorded=False) as advance:
            for first in range(0, len(cells), _SAMPLES_AT_ONCE):
                if self.watch is not None:
                    self.watch(first / len(cells), len(cells) - first)
                some = cells[first : first + _SAMPLES_AT_ONCE]
                with self.stages.part("rasterize"):
                    places = some + np.int32(level.first)
                    spots = level.spots[some]
                    places, samples = self._samples(k, (places, level.texels[some], spots))
                self._cast(places, samples, k)
                advance(len(some))
        if self.watch is not None and len(cells):
            self.watch(1.0, 0)
        return level

    def _samples(self, k: int, cells: SampledCells) -> tuple[IntArray, Samples]:
        """Place samples in cells of the k-th level; the first gives its face to a bare texel."""
        places, samples = cell_samples(
            self.bins, self.coverage, k, self.trace.texel_faces, cells, threads=self.threads
        )
        owners = self.trace.texel_faces.reshape(-1)
        new = owners[samples.texel_ids] == NO_FACE
        if new.any():
            # The last one written wins: in reverse order, that is the first sample.
            owners[samples.texel_ids[new][::-1]] = samples.faces[new][::-1]
        return places, samples

    def _cast(self, places: IntArray, samples: Samples, level: int) -> None:
        """Cast the samples of cells of a level, and keep the values of those that hit."""
        self.trace.counts.samples_covered += len(samples)
        self.cells.is_cast[places] = True
        height, width = self.shape
        hits = self.trace.cast(samples, SampleGrid(width, height, 1 << level))
        with self.stages.part("make maps"):
            if level == 0:
                self._distances.add(hits, threads=self.threads)
            is_hit = hits.is_hit
            if not is_hit.all():
                places, hits = places[is_hit], hits.where(is_hit)
            charts = self.inputs.low_surface.charts[hits.low_faces]
            for kind, channels in self.channels():
                values = kind.values(hits, self.inputs)
                self.cells.keep(places, charts, values, channels.start, self.threads)
