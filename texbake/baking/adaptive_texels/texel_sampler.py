"""Casts the samples of texels and of their cells, and keeps the values that they give."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from texbake.baking.adaptive_texels.cells import BoolArray, Cells, Level, in_tiles
from texbake.baking.adaptive_texels.coverage import (
    FULL,
    CellSamples,
    FaceBins,
    SampledCells,
    TexelCoverage,
    cell_samples,
    outlined_texels,
)
from texbake.baking.hits import Hits
from texbake.baking.maps import MapKind
from texbake.baking.report import DistanceSummary
from texbake.baking.texels import NO_FACE, SampleGrid, owned_bands
from texbake.baking.trace import SampleCaster, Trace
from texbake.mesh.mesh import IntArray

# So few that what one step writes is still in the cache when the next one reads it.
_SAMPLES_AT_ONCE = 1 << 17


class TexelSampler:
    """Casts samples while the scenes of a trace are open.

    Attributes
    ----------
    shape : (int, int)
        Height and width of the map.
    watch : callable, optional
        Called between parts of the work, with the share of it that is done and the number of cells
        of this level that are left; it may raise an error to end the work.
    """

    def __init__(self, trace: Trace, distances: DistanceSummary, caster: SampleCaster) -> None:
        self.trace, self._distances, self.caster = trace, distances, caster
        self.kinds, self.inputs = trace.setup.kinds, trace.setup.inputs
        self.stages, self.threads = trace.stages, trace.options.threads
        self.shape: tuple[int, int] = trace.texel_faces.shape
        n_texels = trace.texel_faces.size
        self.coverage = TexelCoverage.none(n_texels)
        self.cells = Cells(n_texels, sum(kind.channels for kind in self.kinds))
        with self.stages.part("prepare low-poly mesh"):
            self.bins = FaceBins.of(trace.low, self.shape[1], self.shape[0])
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
            samples = CellSamples.of_texels(band.samples)
            self._cast(samples, 0)
            if self.watch is not None:
                self.watch(band.rows.stop / height, 0)
        with self.stages.stage("bake outlines", recorded=False):
            with self.stages.part("rasterize"):
                texels = np.concatenate(partly)
                no_spots = np.zeros(len(texels), dtype=np.uint8)
                samples = self._samples(0, (texels, texels, no_spots))
            self._cast(samples, 0)

    def _without_parts(self, owners: IntArray, rows: range) -> IntArray:
        """Remove the owners of texels that are not sampled at their center; return these texels."""
        first = rows.start * self.shape[1]
        counts = self.coverage.counts[first : first + owners.size].reshape(owners.shape)
        is_part = (counts > 0) & ((counts < FULL) | (owners == NO_FACE))
        # A texel of which only the center is covered is sampled there.
        masks = self.coverage.masks[first : first + owners.size].reshape(owners.shape)
        is_part &= masks != 0
        owners[is_part] = NO_FACE
        return in_tiles(is_part, int(np.count_nonzero(is_part))) + np.int32(first)

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
                    samples = self._samples(k, (places, level.texels[some], level.spots[some]))
                self._cast(samples, k)
                advance(len(some))
        if self.watch is not None and len(cells):
            self.watch(1.0, 0)
        return level

    def _samples(self, k: int, cells: SampledCells) -> CellSamples:
        """Place samples in cells of the k-th level; the first gives its face to a bare texel."""
        samples = cell_samples(
            self.bins, self.coverage, k, self.trace.texel_faces, cells, threads=self.threads
        )
        owners = self.trace.texel_faces.reshape(-1)
        new = owners[samples.texel_ids] == NO_FACE
        if new.any():
            # The last one written wins: in reverse order, that is the first sample.
            owners[samples.texel_ids[new][::-1]] = samples.faces[new][::-1]
        return samples

    def _cast(self, samples: CellSamples, level: int) -> None:
        """Cast some samples of cells of a level, and keep the values of those that hit."""
        self.trace.counts.samples_covered += len(samples)
        self.cells.is_cast[samples.places] = True
        height, width = self.shape
        hits = self.caster.cast(samples.samples, SampleGrid(width, height, 1 << level))
        self._keep(samples.places, hits, level == 0)

    def _keep(self, places: IntArray, hits: Hits, of_texels: bool) -> None:
        """Keep the values of hits at the places of their cells."""
        with self.stages.part("make maps"):
            if of_texels:
                self._distances.add(hits, threads=self.threads)
            is_hit = hits.is_hit
            if not is_hit.all():
                places, hits = places[is_hit], hits.where(is_hit)
            charts = self.inputs.low_surface.charts[hits.low_faces]
            for kind, channels in self.channels():
                values = kind.values(hits, self.inputs)
                self.cells.keep(places, charts, values, channels.start, self.threads)
