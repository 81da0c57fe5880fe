"""A bound on the error becomes samples: one per texel, and more where neighboring ones disagree.

Each level of cells is cast whole before it is decided which of them are divided, so the result is
the same for any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from texbake.baking.adaptive_texels.bounded_maps import (
    BakeSampling,
    BoundedMap,
    bounded_maps,
    metric_of,
)
from texbake.baking.adaptive_texels.cells import (
    LAST_LEVEL,
    NO_CHART,
    BoolArray,
    Cells,
    FloatArray32,
    Level,
    gather,
    in_tiles,
)
from texbake.baking.adaptive_texels.coverage import (
    FULL,
    CellSamples,
    FaceBins,
    TexelCoverage,
    cell_samples,
    outlined_texels,
)
from texbake.baking.adaptive_texels.recheck import Recheck
from texbake.baking.adaptive_texels.texel_error import FOUR_SAMPLES, ONE_SAMPLE, TexelError
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.pineda import NO_FACE
from texbake.baking.report import DistanceSummary
from texbake.baking.sums import TexelSums
from texbake.baking.texels import SampleGrid, owned_bands
from texbake.baking.trace import SampleCaster, Trace
from texbake.mesh.mesh import IntArray
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT
from texbake.sampling.report import percent_within

# So few that what one step writes is still in the cache when the next one reads it.
_SAMPLES_AT_ONCE = 1 << 17


class AdaptiveSamples:
    """Casts the samples of a bake, level by level, and makes the values of its texels.

    Parameters
    ----------
    distances : DistanceSummary
        Gets the hits of the first sample of each texel.
    rows : sequence of range, optional
        Rows of texels to bake, in their order; None for all. The others are left out as if no face
        covered them.

    Raises
    ------
    OptionError
        `BakeOptions.max_error` bounds none of the maps.
    """

    def __init__(
        self,
        kinds: list[MapKind],
        trace: Trace,
        inputs: BakeInputs,
        stages: Stages,
        distances: DistanceSummary,
        *,
        rows: Sequence[range] | None = None,
    ) -> None:
        options = inputs.options
        self._kinds, self._trace, self._inputs = kinds, trace, inputs
        self._stages, self._distances = stages, distances
        self._shape = (options.height_px, options.width_px)
        self._threads = options.threads
        self._rows = [range(self._shape[0])] if rows is None else list(rows)
        self._bounded = bounded_maps(kinds, inputs)
        n_texels = self._shape[0] * self._shape[1]
        self._coverage = TexelCoverage.none(n_texels)
        self._cells = Cells(n_texels, sum(kind.channels for kind in kinds))
        self._estimate = self._estimate_for(self._bounded)
        self._errors: FloatArray32 = np.zeros(n_texels, dtype=np.float32)
        self._finest = np.zeros(n_texels, dtype=np.uint8)

    def cast(self, sums: TexelSums) -> BakeSampling:
        """Cast all samples, give the means of texels to `sums`, and check some of them."""
        with self._trace.casting() as caster:
            with self._stages.part("prepare low-poly mesh"):
                bins = FaceBins.of(self._inputs.low, self._shape[1], self._shape[0])
            self._cast_texels(caster, bins)
            means = self._refine(caster, bins)
            has_data = self._cells.charts[: len(means)] != NO_CHART
            with self._stages.part("make maps"):
                has_data |= self._take_means(means)
                by_kind = {
                    kind: self._cells.firsts(len(means), channels)
                    if kind.combine == "first"
                    else np.ascontiguousarray(means[:, channels])
                    for kind, channels in self._channels()
                }
                sums.place(by_kind, has_data)
            with self._stages.stage("check errors"):
                return self._report(caster, bins, by_kind, has_data)

    def _cast_texels(self, caster: SampleCaster, bins: FaceBins) -> None:
        """Cast the first sample of each texel, and measure how much of it is covered."""
        height, width = self._shape
        grid = SampleGrid(width, height, 1)
        with self._stages.part("rasterize"):
            outlined = outlined_texels(bins, width, height)
        partly: list[IntArray] = []  # texels that are not sampled at their center

        def measure(owners: IntArray, rows: range) -> None:
            self._trace.texel_faces[rows.start : rows.stop] = owners
            self._coverage.measure(bins, owners, outlined, rows, self._threads)
            partly.append(self._without_parts(owners, rows))

        for band in owned_bands(
            self._trace.snap(grid),
            grid,
            self._stages,
            rows=self._rows,
            samples_at_once=_SAMPLES_AT_ONCE,
            edit=measure,
            threads=self._threads,
        ):
            self._trace.counts.samples_overlapping += band.n_overlaps
            samples = CellSamples.of_texels(band.samples)
            self._cast_samples(samples, caster, 0)
        with self._stages.stage("bake outlines", recorded=False):
            with self._stages.part("rasterize"):
                texels = np.concatenate(partly)
                no_spots = np.zeros(len(texels), dtype=np.uint8)
                samples = self._samples(bins, 0, (texels, texels, no_spots))
            self._cast_samples(samples, caster, 0)

    def _without_parts(self, owners: IntArray, rows: range) -> IntArray:
        """Remove the owners of texels that are not sampled at their center; return these texels."""
        first = rows.start * self._shape[1]
        counts = self._coverage.counts[first : first + owners.size].reshape(owners.shape)
        is_part = (counts > 0) & ((counts < FULL) | (owners == NO_FACE))
        # A texel of which only the center is covered is sampled there.
        masks = self._coverage.masks[first : first + owners.size].reshape(owners.shape)
        is_part &= masks != 0
        owners[is_part] = NO_FACE
        return in_tiles(is_part, int(np.count_nonzero(is_part))) + np.int32(first)

    def _refine(self, caster: SampleCaster, bins: FaceBins) -> FloatArray32:
        """Divide texels and judge them again; return the means of texels with up to 4 samples."""
        with self._stages.part("estimate errors"):
            means, steps = self._estimate.of_samples()
            self._errors[:] = ONE_SAMPLE * steps
            is_divided = self._errors > 1.0
            n_divided = int(np.count_nonzero(is_divided))
            texels = in_tiles(is_divided.reshape(self._shape), n_divided)
            # Where four samples would be too few, a texel gets 16 at once.
            is_jump = FOUR_SAMPLES * steps[texels] > 1.0
        level = self._divide(texels, caster, bins, np.repeat(~is_jump, 4))
        with self._stages.part("estimate errors"):
            errors = self._estimate.of_four(steps, texels, means)
            self._errors[texels], self._finest[texels] = errors, 1
            is_further = errors > 1.0
            self._errors[texels[is_further]] = 0.0
            divided = np.repeat(is_further, 4) & (level.weights > 0)
        for k in range(2, LAST_LEVEL + 1):
            places = (level.first + np.flatnonzero(divided)).astype(np.int32)
            level = self._divide(places, caster, bins, None)
            with self._stages.part("estimate errors"):
                self._finest[level.texels] = k
                errors = self._estimate.of_cells(k)
                divided = self._estimate.divide(level, k, errors, self._errors)
        return means

    def _divide(
        self, places: IntArray, caster: SampleCaster, bins: FaceBins, is_cast: BoolArray | None
    ) -> Level:
        """Divide some cells of the last level and cast their children, or some of these."""
        level = self._cells.add(places, self._coverage)
        k = len(self._cells.levels)
        chosen = level.weights > 0
        if is_cast is not None:
            chosen &= is_cast
        cells = np.flatnonzero(chosen).astype(np.int32)
        name = f"bake {1 << k} x {1 << k}"
        with self._stages.stage(name, total=len(cells), unit="cells", recorded=False) as advance:
            for first in range(0, len(cells), _SAMPLES_AT_ONCE):
                some = cells[first : first + _SAMPLES_AT_ONCE]
                with self._stages.part("rasterize"):
                    places = some + np.int32(level.first)
                    samples = self._samples(
                        bins, k, (places, level.texels[some], level.spots[some])
                    )
                self._cast_samples(samples, caster, k)
                advance(len(some))
        return level

    def _samples(
        self, bins: FaceBins, k: int, cells: tuple[IntArray, IntArray, npt.NDArray[np.uint8]]
    ) -> CellSamples:
        """Place samples in cells of the k-th level; the first gives its face to a bare texel."""
        samples = cell_samples(
            bins, self._coverage, k, self._trace.texel_faces, cells, threads=self._threads
        )
        owners = self._trace.texel_faces.reshape(-1)
        new = owners[samples.texel_ids] == NO_FACE
        if new.any():
            # The last one written wins: in reverse order, that is the first sample.
            owners[samples.texel_ids[new][::-1]] = samples.faces[new][::-1]
        return samples

    def _cast_samples(self, samples: CellSamples, caster: SampleCaster, level: int) -> None:
        """Cast some samples of cells of a level, and keep the values of those that hit."""
        self._trace.counts.samples_covered += len(samples)
        height, width = self._shape
        hits = caster.cast(samples.samples, SampleGrid(width, height, 1 << level))
        self._keep(samples.places, hits, level == 0)

    def _keep(self, places: IntArray, hits: Hits, of_texels: bool) -> None:
        """Keep the values of hits at the places of their cells."""
        with self._stages.part("make maps"):
            if of_texels:
                self._distances.add(hits, threads=self._threads)
            is_hit = hits.high_faces != NO_HIT
            if not is_hit.all():
                places, hits = places[is_hit], hits.where(is_hit)
            charts = self._inputs.low_surface.charts[hits.low_faces]
            for kind, channels in self._channels():
                values = kind.values(hits, self._inputs)
                self._cells.keep(places, charts, values, channels.start, self._threads)

    def _take_means(self, means: FloatArray32) -> BoolArray:
        """Write the means of texels with more than 4 samples; return which texels have any."""
        areas = np.zeros(len(means), dtype=np.float32)
        sums = np.zeros_like(means)
        for level in self._cells.levels[1:]:
            gather(self._cells, level, sums, areas)
        texels = np.flatnonzero(areas)
        means[texels] = sums[texels] / areas[texels, np.newaxis]
        return np.asarray(areas > 0.0)

    def _report(
        self,
        caster: SampleCaster,
        bins: FaceBins,
        means: dict[MapKind, FloatArray32],
        has_data: BoolArray,
    ) -> BakeSampling:
        counts = self._trace.counts
        n_covered = max(int(np.count_nonzero(has_data)), 1)
        n_rays = counts.rays_cast
        finest = np.bincount(self._finest[has_data], minlength=LAST_LEVEL + 1)
        recheck = Recheck(bins, self._inputs, caster, has_data)
        errors = tuple(
            item.summary(
                self._errors_of(item)[has_data], recheck.differences(item.kind, means[item.kind])
            )
            for item in self._bounded
        )
        bounded = {item.kind for item in self._bounded}
        return BakeSampling(
            max_error=str(self._inputs.options.error_bounds),
            sample_percents={4**k: 100.0 * n / n_covered for k, n in enumerate(finest.tolist())},
            within_percent=percent_within(self._errors[has_data], 1.0),
            n_checked=len(recheck.texels),
            samples_of_check=recheck.n_samples,
            errors=errors,
            rays_per_texel=n_rays / n_covered,
            rays_of_check=counts.rays_cast - n_rays,
            unbounded=tuple(kind.name for kind in self._kinds if kind not in bounded),
        )

    def _errors_of(self, item: BoundedMap) -> FloatArray32:
        """Estimated errors of one map, in its bound."""
        if len(self._bounded) == 1:
            return self._errors
        return self._estimate_for([item]).of_divided()

    def _estimate_for(self, bounded: list[BoundedMap]) -> TexelError:
        metric = metric_of(bounded, self._kinds)
        return TexelError(self._cells, self._coverage, self._shape, metric, self._threads)

    def _channels(self) -> Iterator[tuple[MapKind, slice]]:
        """Yield each map with its columns among the values."""
        first = 0
        for kind in self._kinds:
            yield kind, slice(first, first + kind.channels)
            first += kind.channels
