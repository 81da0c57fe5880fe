"""As many samples as each texel needs: one each, and more where those beside each other disagree.

Each level of cells is cast whole before it is decided which of them are divided, so that the result
is the same for any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from texbake.baking.cell_errors import divide, judge_cells
from texbake.baking.cell_samples import cell_samples
from texbake.baking.cells import (
    LAST_LEVEL,
    NO_CHART,
    TILE,
    BoolArray,
    Cells,
    FloatArray32,
    Level,
    gather,
    in_tiles,
)
from texbake.baking.coverage import (
    FULL,
    Coverage,
    FaceBins,
    outlined_texels,
)
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.map_errors import errors_of_map
from texbake.baking.maps.kind import MapKind
from texbake.baking.neighbors import Metric
from texbake.baking.quarter_errors import judge_quarters
from texbake.baking.recast import Recast
from texbake.baking.report import DistanceSummary
from texbake.baking.sampling import (
    BoundedMap,
    MapErrors,
    SamplingReport,
    bounded_maps,
    metric_of,
)
from texbake.baking.sums import TexelSums
from texbake.baking.texel_errors import ONE_SAMPLE, judge_texels
from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    Samples,
    owned_samples,
    rasterize_uv,
)
from texbake.baking.trace import Casts, Lost, Trace
from texbake.mesh.mesh import IntArray
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT

# What four samples may be off by, in second differences: where that is too much, a texel gets 16 at
# once.
_FOUR_SAMPLES = 0.05
# So few that what one step writes is still in the cache when the next one reads it.
_SAMPLES_AT_ONCE = 1 << 17

Cast = tuple[Casts, list[Lost]]


class AdaptiveSamples:
    """Casts the samples of a bake, level by level, and makes the values of its texels.

    Parameters
    ----------
    distances : DistanceSummary
        Is told of the hits of the first sample of each texel.
    rows : sequence of range, optional
        Rows of texels to bake, in their order; None for all. What lies between is left out as if no
        face covered it.

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
        self._coverage = Coverage.none(n_texels)
        self._cells = Cells(n_texels, sum(kind.channels for kind in kinds))
        self._errors: FloatArray32 = np.zeros(n_texels, dtype=np.float32)
        self._finest = np.zeros(n_texels, dtype=np.uint8)

    def cast(self, sums: TexelSums) -> SamplingReport:
        """Cast all samples, give the means of texels to `sums`, and check some of them."""
        with self._trace.casting() as casts:
            with self._stages.part("prepare light mesh"):
                bins = FaceBins.of(self._inputs.low, self._shape[1], self._shape[0])
            self._cast_texels(casts, bins)
            means = self._refine(casts, bins)
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
                return self._report(casts, bins, by_kind, has_data)

    def _cast_texels(self, casts: Casts, bins: FaceBins) -> None:
        """Cast the first sample of each texel, and see how much of it is covered."""
        height, width = self._shape
        grid, threads = SampleGrid(width, height, 1), self._threads
        faces = self._trace.snap(grid)
        with self._stages.part("rasterize"):
            outlined = outlined_texels(bins, width, height)
        missed: list[Lost] = []
        parts = []
        n_texels = sum(map(len, self._rows)) * width
        with self._stages.stage("bake", total=n_texels, unit="texels", recorded=False) as advance:
            for rows in self._bands(grid):
                with self._stages.part("rasterize"):
                    owners, n_overlaps = rasterize_uv(faces, grid, rows, threads=threads)
                    self._trace.texel_faces[rows.start : rows.stop] = owners
                    self._trace.counts.samples_overlapping += n_overlaps
                    self._coverage.see(bins, owners, outlined, rows, threads)
                    parts.append(self._without_parts(owners, rows))
                    samples = owned_samples(owners, faces, grid, rows.start, threads=threads)
                self._look(samples, (casts, missed), of_texels=True)
                advance(len(rows) * width)
            with self._stages.part("rasterize"):
                texels = np.concatenate(parts)
                no_spots = np.zeros(len(texels), dtype=np.uint8)
                samples = self._samples(bins, 0, (texels, texels, no_spots))
            self._look(samples, (casts, missed), of_texels=True)
            self._look_again((casts, missed))

    def _without_parts(self, owners: IntArray, rows: range) -> IntArray:
        """Take from the owners those texels that have their sample elsewhere; return their ids."""
        first = rows.start * self._shape[1]
        counts = self._coverage.counts[first : first + owners.size].reshape(owners.shape)
        is_part = (counts > 0) & ((counts < FULL) | (owners == NO_FACE))
        # A texel with but its center is sampled there.
        masks = self._coverage.masks[first : first + owners.size].reshape(owners.shape)
        is_part &= masks != 0
        owners[is_part] = NO_FACE
        return in_tiles(is_part, int(np.count_nonzero(is_part))) + np.int32(first)

    def _refine(self, casts: Casts, bins: FaceBins) -> FloatArray32:
        """Divide texels, and judge them again; return the means of those with up to 4 samples."""
        with self._stages.part("estimate errors"):
            means, steps = judge_texels(
                self._cells, self._coverage, self._shape, self._metric, self._threads
            )
            self._errors[:] = ONE_SAMPLE * steps
            is_divided = self._errors > 1.0
            n_divided = int(np.count_nonzero(is_divided))
            texels = in_tiles(is_divided.reshape(self._shape), n_divided)
            is_jump = _FOUR_SAMPLES * steps[texels] > 1.0
        level = self._divide(texels, casts, bins, np.repeat(~is_jump, 4))
        with self._stages.part("estimate errors"):
            errors = judge_quarters(
                self._cells, self._coverage, self._shape, self._metric, steps, texels, means,
                self._threads,
            )  # fmt: skip
            self._errors[texels], self._finest[texels] = errors, 1
            is_further = errors > 1.0
            self._errors[texels[is_further]] = 0.0
            divided = np.repeat(is_further, 4) & (level.weights > 0)
        for k in range(2, LAST_LEVEL + 1):
            places = (level.first + np.flatnonzero(divided)).astype(np.int32)
            level = self._divide(places, casts, bins, None)
            with self._stages.part("estimate errors"):
                self._finest[level.texels] = k
                errors = judge_cells(self._cells, k, self._shape, self._metric, self._threads)
                divided = divide(level, k, errors, self._coverage, self._errors)
        return means

    def _divide(
        self, places: IntArray, casts: Casts, bins: FaceBins, is_cast: BoolArray | None
    ) -> Level:
        """Divide some cells of the last level and cast their children, or those that are chosen."""
        level = self._cells.add(places, self._coverage)
        k = len(self._cells.levels)
        missed: list[Lost] = []
        chosen = level.weights > 0
        if is_cast is not None:
            chosen &= is_cast
        cells = np.flatnonzero(chosen).astype(np.int32)
        name = f"bake {1 << k} x {1 << k}"
        with self._stages.stage(name, total=len(cells), unit="cells", recorded=False) as advance:
            for first in range(0, len(cells), _SAMPLES_AT_ONCE):
                some = cells[first : first + _SAMPLES_AT_ONCE]
                with self._stages.part("rasterize"):
                    told = (some + np.int32(level.first), level.texels[some], level.spots[some])
                    samples = self._samples(bins, k, told)
                self._look(samples, (casts, missed))
                advance(len(some))
            self._look_again((casts, missed))
        return level

    def _samples(
        self, bins: FaceBins, k: int, cells: tuple[IntArray, IntArray, npt.NDArray[np.uint8]]
    ) -> Samples:
        """Samples of some cells of the k-th level; the first gives its face to a texel without."""
        samples, texels = cell_samples(
            bins, self._coverage, k, self._trace.texel_faces, cells, threads=self._threads
        )
        owners = self._trace.texel_faces.reshape(-1)
        new = owners[texels] == NO_FACE
        if new.any():
            owners[texels[new][::-1]] = samples.faces[new][::-1]
        return samples

    def _look(self, samples: Samples, cast: Cast, *, of_texels: bool = False) -> None:
        """Cast some samples and keep the values of those that hit."""
        casts, missed = cast
        self._trace.counts.samples_covered += len(samples)
        hits, lost = casts.look(samples)
        if lost is not None:
            missed.append(lost)
        self._keep(hits, of_texels)

    def _look_again(self, cast: Cast) -> None:
        casts, missed = cast
        if missed:
            self._keep(casts.look_again(missed), False)

    def _keep(self, hits: Hits, of_texels: bool) -> None:
        """Write the values of hits, whose texel ids are places of cells."""
        with self._stages.part("make maps"):
            if of_texels:
                self._distances.add(hits, threads=self._threads)
            is_hit = hits.high_faces != NO_HIT
            if not is_hit.all():
                hits = hits.where(is_hit)
            charts = self._inputs.low_charts[hits.low_faces]
            for kind, channels in self._channels():
                values = kind.values(hits, self._inputs)
                self._cells.keep(hits.texel_ids, charts, values, channels.start, self._threads)

    def _take_means(self, means: FloatArray32) -> BoolArray:
        """Write the means of texels with more than 4 samples; tell which have any."""
        areas = np.zeros(len(means), dtype=np.float32)
        sums = np.zeros_like(means)
        for level in self._cells.levels[1:]:
            gather(self._cells, level, sums, areas)
        texels = np.flatnonzero(areas)
        means[texels] = sums[texels] / areas[texels, np.newaxis]
        return np.asarray(areas > 0.0)

    def _report(
        self, casts: Casts, bins: FaceBins, means: dict[MapKind, FloatArray32], has_data: BoolArray
    ) -> SamplingReport:
        counts = self._trace.counts
        n_covered = max(int(np.count_nonzero(has_data)), 1)
        n_rays = counts.rays_cast
        finest = np.bincount(self._finest[has_data], minlength=LAST_LEVEL + 1)
        errors = self._errors[has_data]
        recast = Recast(bins, self._inputs, casts, has_data)
        maps = [
            MapErrors.of(
                item,
                self._errors_of(item)[has_data],
                recast.differences(item.kind, means[item.kind]),
            )
            for item in self._bounded
        ]
        return SamplingReport(
            max_error=str(self._inputs.options.error_bounds),
            texel_percents={4**k: 100.0 * n / n_covered for k, n in enumerate(finest.tolist())},
            rays_per_texel=n_rays / n_covered,
            within_percent=100.0 * int(np.count_nonzero(errors <= 1.0)) / n_covered,
            texels_checked=len(recast.texels),
            samples_of_check=recast.n_samples,
            rays_of_check=counts.rays_cast - n_rays,
            maps=maps,
            unbounded=[k.name for k in self._kinds if k not in {b.kind for b in self._bounded}],
        )

    def _errors_of(self, item: BoundedMap) -> FloatArray32:
        """Estimated errors of one map, in its bound."""
        if len(self._bounded) == 1:
            return self._errors
        metric = metric_of([item], self._kinds)
        return errors_of_map(self._cells, self._coverage, self._shape, metric, self._threads)

    def _bands(self, grid: SampleGrid) -> Iterator[range]:
        """Some rows of texels at once, in whole rows of tiles."""
        step = max(_SAMPLES_AT_ONCE // (grid.width * TILE), 1) * TILE
        for rows in self._rows:
            for first in range(rows.start, rows.stop, step):
                yield range(first, min(first + step, rows.stop))

    def _channels(self) -> Iterator[tuple[MapKind, slice]]:
        """Each map with its columns among the values."""
        first = 0
        for kind in self._kinds:
            yield kind, slice(first, first + kind.channels)
            first += kind.channels

    @property
    def _metric(self) -> Metric:
        return metric_of(self._bounded, self._kinds)
