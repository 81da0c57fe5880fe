"""As many samples as each texel needs: one each, and more where those beside each other disagree.

Each level of cells is cast whole before it is decided which of them are divided, so that the result
is the same for any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.bake.cell_errors import Metric, estimate_errors
from texbake.bake.cells import (
    COVERAGE_SIDE,
    LAST_LEVEL,
    Level,
    TexelState,
    cell_samples,
    count_covered,
    divide,
    gather,
)
from texbake.bake.hits import NO_HIT, Hits
from texbake.bake.inputs import BakeInputs
from texbake.bake.maps.kind import MapKind
from texbake.bake.recast import Recast
from texbake.bake.report import DistanceSummary
from texbake.bake.sampling import MapErrors, SamplingReport, bounded_maps, percentiles_of
from texbake.bake.sums import TexelSums
from texbake.bake.texels import (
    NO_FACE,
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_samples,
    rasterize_uv,
    snap_uvs,
)
from texbake.bake.trace import Casts, Lost, Trace, rows_at_once
from texbake.errors import OptionError
from texbake.mesh.mesh import IntArray
from texbake.progress import Stages

BoolArray = npt.NDArray[np.bool_]
Float32Array = npt.NDArray[np.float32]


class AdaptiveSamples:
    """Casts the samples of a bake, level by level, and makes the values of its texels.

    Parameters
    ----------
    distances : DistanceSummary
        Is told of all hits.
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
        self._rows = [range(self._shape[0])] if rows is None else list(rows)
        self._bounded = bounded_maps(kinds, inputs)
        if not self._bounded:
            names = ", ".join(kind.name for kind in kinds)
            raise OptionError(
                f"max-error: {options.error_bounds} bounds nothing of {names}; "
                "give an angle for normals, a length for displacements"
            )
        self._state = TexelState(self._shape[0] * self._shape[1])
        self._levels: list[Level] = []

    def cast(self, sums: TexelSums) -> SamplingReport:
        """Cast all samples, give the means of texels to `sums`, and check some of them."""
        with self._trace.casting() as casts:
            self._cast_texels(casts)
            while len(children := self._divided()):
                self._cast_children(casts, children)
            with self._stages.part("make maps"):
                means, has_data = self._means()
                sums.place(means, has_data)
            with self._stages.stage("check errors"):
                return self._report(casts, means, has_data)

    def _cast_texels(self, casts: Casts) -> None:
        """Cast the first sample of each texel, and see how much of it is covered."""
        grid, threads = self._grid(1), self._inputs.options.threads
        covering = self._grid(COVERAGE_SIDE)
        faces, fine_faces = self._trace.snap(grid), snap_uvs(self._inputs.low, covering)
        texels = np.arange(self._shape[0] * self._shape[1], dtype=np.int64)
        level = self._new_level(texels)
        missed: list[Lost] = []
        n_texels = sum(map(len, self._rows)) * self._shape[1]
        with self._stages.stage("bake", total=n_texels, unit="texels", recorded=False) as advance:
            for rows in self._bands(1):
                with self._stages.part("rasterize"):
                    owners, _ = rasterize_uv(faces, grid, rows, threads=threads)
                    samples = owned_samples(owners, faces, grid, rows.start, threads=threads)
                    self._trace.texel_faces[rows.start : rows.stop] = owners
                    self._see_coverage(fine_faces, covering, rows)
                self._take(level, casts, samples, missed)
                advance(len(rows) * self._shape[1])
        self._take_recovered(level, casts, missed)

    def _see_coverage(self, faces: SnappedFaces, grid: SampleGrid, rows: range) -> None:
        threads, width = self._inputs.options.threads, self._shape[1]
        step = rows_at_once(grid)
        for first in range(rows.start, rows.stop, step):
            part = range(first, min(first + step, rows.stop))
            owners, n_overlaps = rasterize_uv(faces, grid, part, threads=threads)
            counts = count_covered(owners, width, threads)
            self._state.covered[part.start * width : part.stop * width] = counts
            self._trace.counts.samples_overlapping += n_overlaps

    def _cast_children(self, casts: Casts, ids: npt.NDArray[np.int64]) -> None:
        """Cast the cells of the next level, by bands of the texels that they lie in."""
        k = len(self._levels)
        grid, threads = self._grid(1 << k), self._inputs.options.threads
        level = self._new_level(ids)
        faces = snap_uvs(self._inputs.low, grid)
        # Cells of one row of texels lie together, in the order of the rows.
        texel_rows = (ids // grid.n_columns) >> k
        missed: list[Lost] = []
        name = f"bake {1 << k} x {1 << k}"
        with self._stages.stage(name, total=len(ids), unit="cells", recorded=False) as advance:
            for rows in self._bands(1 << k):
                first, last = np.searchsorted(texel_rows, [rows.start, rows.stop]).tolist()
                if first == last:
                    continue
                with self._stages.part("rasterize"):
                    owners, _ = rasterize_uv(faces, grid, rows, threads=threads)
                    samples = cell_samples(
                        owners,
                        faces,
                        grid,
                        rows.start * grid.per_side,
                        ids[first:last],
                        first,
                        threads=threads,
                    )
                    self._note_faces(samples)
                self._take(level, casts, samples, missed)
                advance(last - first)
        self._take_recovered(level, casts, missed)

    def _take(self, level: Level, casts: Casts, samples: Samples, missed: list[Lost]) -> None:
        """Cast some samples of the last level and keep the values of those that hit."""
        self._trace.counts.samples_covered += len(samples)
        hits, lost = casts.look(samples)
        if lost is not None:
            missed.append(lost)
        self._keep(level, hits)

    def _take_recovered(self, level: Level, casts: Casts, missed: list[Lost]) -> None:
        if missed:
            self._keep(level, casts.look_again(missed))

    def _keep(self, level: Level, hits: Hits) -> None:
        """Write the values of hits, whose texel ids are places on the level."""
        with self._stages.part("make maps"):
            self._distances.add(hits, threads=self._inputs.options.threads)
            is_hit = hits.high_faces != NO_HIT
            if not is_hit.all():
                hits = hits.where(is_hit)
            places = hits.texel_ids
            level.charts[places] = self._inputs.low_charts[hits.low_faces]
            for kind, channels in self._channels():
                level.values[places, channels] = kind.values(hits, self._inputs)
            self._state.has_value[self._texels_of(level, places)] = True

    def _divided(self) -> npt.NDArray[np.int64]:
        """Divide cells of the last level where their texels may be off by too much."""
        with self._stages.part("estimate errors"):
            threads = self._inputs.options.threads
            errors = estimate_errors(self._levels, self._shape, self._metric, self._state, threads)
            return divide(self._levels, self._shape, errors, self._state)

    def _means(self) -> tuple[dict[MapKind, Float32Array], BoolArray]:
        sums, areas = gather(self._levels, self._shape, self._state)
        has_data = areas > 0.0
        areas[~has_data] = 1.0
        sums /= areas[:, np.newaxis]
        means = {
            kind: np.ascontiguousarray(sums[:, channels]) for kind, channels in self._channels()
        }
        return means, has_data

    def _report(
        self, casts: Casts, means: dict[MapKind, Float32Array], has_data: BoolArray
    ) -> SamplingReport:
        counts, state = self._trace.counts, self._state
        n_covered = max(int(np.count_nonzero(has_data)), 1)
        n_rays = counts.rays_cast
        finest = np.bincount(state.finest[has_data], minlength=LAST_LEVEL + 1)
        errors = state.errors[has_data]
        recast = Recast(self._trace, self._inputs, casts, has_data)
        maps = []
        for item in self._bounded:
            measured = item.told(recast.differences(item.kind, means[item.kind]))
            within = int(np.count_nonzero(measured <= item.told(np.array(item.bound))))
            maps.append(
                MapErrors(
                    name=item.kind.name,
                    unit=item.unit,
                    bound=float(item.told(np.array(item.bound))),
                    estimated=percentiles_of(item.told(errors * item.bound)),
                    measured=percentiles_of(measured),
                    measured_within_percent=100.0 * within / max(len(measured), 1),
                )
            )
        return SamplingReport(
            max_error=str(self._inputs.options.error_bounds),
            texel_percents={4**k: 100.0 * n / n_covered for k, n in enumerate(finest.tolist())},
            rays_per_texel=n_rays / n_covered,
            within_percent=100.0 * int(np.count_nonzero(errors <= 1.0)) / n_covered,
            texels_checked=len(recast.texels),
            samples_of_check=recast.n_samples,
            rays_of_check=counts.rays_cast - n_rays,
            maps=maps,
        )

    def _new_level(self, ids: npt.NDArray[np.int64]) -> Level:
        level = Level.of(ids, sum(kind.channels for kind in self._kinds))
        self._levels.append(level)
        return level

    def _note_faces(self, samples: Samples) -> None:
        """Let texels without a face at their center have the first that owns a sample of them."""
        texels = self._texels_of(self._levels[-1], samples.texel_ids)
        owners = self._trace.texel_faces.reshape(-1)
        new = owners[texels] == NO_FACE
        owners[texels[new][::-1]] = samples.faces[new][::-1]

    def _texels_of(self, level: Level, places: IntArray) -> npt.NDArray[Any]:
        k, width = len(self._levels) - 1, self._shape[1]
        if k == 0:
            return places
        rows, columns = np.divmod(level.ids[places], width << k)
        return (rows >> k) * width + (columns >> k)

    def _bands(self, per_side: int) -> Iterator[range]:
        """Some rows of texels at once, in whole rows of tiles."""
        step = rows_at_once(self._grid(per_side))
        for rows in self._rows:
            for first in range(rows.start, rows.stop, step):
                yield range(first, min(first + step, rows.stop))

    def _grid(self, per_side: int) -> SampleGrid:
        return SampleGrid(self._shape[1], self._shape[0], per_side)

    def _channels(self) -> Iterator[tuple[MapKind, slice]]:
        """Each map with its columns among the values."""
        first = 0
        for kind in self._kinds:
            yield kind, slice(first, first + kind.channels)
            first += kind.channels

    @property
    def _metric(self) -> Metric:
        bounds = {item.kind: item.bound for item in self._bounded}
        groups = [i for i, kind in enumerate(self._kinds) for _ in range(kind.channels)]
        scales = [1.0 / bounds[kind] if kind in bounds else 0.0 for kind in self._kinds]
        return Metric(np.array(groups, dtype=np.int32), np.array(scales))
