"""Texels divided until their estimated errors are within a bound.

The error of a texel, how far its samples may be from the mean over it, is estimated from those
beside it. Each level of cells is cast whole before it is decided which of them are divided, so the
result is the same for any number of threads.

Texels with one sample are judged by the second difference s of the values along each axis, taken
from the texels on both sides or, at the border of a chart, from two on one side. Where the values
bend by s along a line through the center, the mean is off by s / 8; where they jump by s, by up to
s / 2; where they curve evenly, by s / 24, always towards the neighbors. A share of s is therefore
added to the sample: 1 / 18 leaves the least squares over bends at random places, and a third of the
error of values that curve evenly. Partly covered texels are not sampled at their centers and do not
show how values change. They are judged by the wholly covered texels beside them, and by how far
they deviate from an even change.

Texels with four more samples, and finer cells, are judged by how far these deviate from what the
first sample and its neighbors predict, with the shares that leave the least squares over maps of
scans. What lies between all samples goes unnoticed.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980; the shares of bends and jumps follow by integration over lines through squares.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from texbake.baking.adaptive_texels.coverage import TexelCoverage
from texbake.baking.adaptive_texels.texel_sampler import (
    LAST_LEVEL,
    NO_CHILD,
    Cells,
    Level,
    TexelSampler,
    in_tiles,
)
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.core import core, portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import AnyArray, BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.sampling.bounds import BOUNDED_CODINGS, ErrorBounds
from texbake.sampling.report import ErrorSummary, percent_within, percentiles_of


@dataclass(frozen=True)
class BoundedMap:
    """A map whose values must be within a bound of the mean over each texel."""

    kind: MapKind
    bound: float  # greatest length of the difference between two values

    @property
    def unit(self) -> str:
        """Unit in which errors of the map are reported."""
        return "deg" if self.kind.coding == "normal" else "model units"

    def in_unit(self, differences: AnyArray) -> FloatArray:
        """Convert differences between values to errors in `unit`."""
        if self.kind.coding != "normal":
            return np.asarray(differences, dtype=np.float64)
        return np.asarray(np.degrees(2.0 * pm.arcsin(np.minimum(differences / 2.0, 1.0))))

    def summary(self, errors: AnyArray, differences: AnyArray) -> ErrorSummary:
        """Summarize `errors` in multiples of the bound, and the `differences` of a check."""
        measured, bound = self.in_unit(differences), float(self.in_unit(np.array(self.bound)))
        estimated = percentiles_of(errors * self.bound)
        return ErrorSummary(
            name=self.kind.name,
            unit=self.unit,
            bound=bound,
            estimated={n: float(self.in_unit(np.array(e))) for n, e in estimated.items()},
            measured=percentiles_of(measured),
            measured_within_percent=percent_within(measured, bound),
        )


def bounded_maps(kinds: list[MapKind], inputs: BakeInputs, bounds: ErrorBounds) -> list[BoundedMap]:
    """Return the maps with bounded errors: not those of secondary rays, whose number decides."""
    bounded = []
    for kind in kinds:
        bound = bounds.of_map(kind.coding, inputs.low.diagonal)
        # A share of a mesh without extent is no length.
        if bound is not None and bound >= sys.float_info.min and kind.needs == "hits":
            bounded.append(BoundedMap(kind, bound))
    if not bounded:
        names = ", ".join(kind.name for kind in kinds)
        if not any(kind.coding in BOUNDED_CODINGS and kind.needs == "hits" for kind in kinds):
            raise OptionError(
                "max_error, time_budget, samples: adaptive samples are for normals and "
                f"displacements, and bound nothing of {names}; give a number of `samples`"
            )
        raise OptionError(
            f"max_error: {bounds} bounds nothing of {names}; "
            "give an angle for normals, a length for displacements"
        )
    return bounded


class Metric(NamedTuple):
    """Measures differences of values in multiples of the error that each map is allowed."""

    firsts: IntArray  # (maps + 1,) int32; first channel of each map, then the number of channels
    # (maps,) float64; 1 / bound of each map; 0 for maps without a bound.
    scales: FloatArray


def metric_of(bounded: list[BoundedMap], kinds: list[MapKind]) -> Metric:
    """Return the metric of some bounds for the values of all maps, side by side."""
    bounds = {item.kind: item.bound for item in bounded}
    firsts = np.cumsum([0, *(kind.channels for kind in kinds)]).astype(np.int32)
    # Heights of a mesh without any size are all alike, and a share of that size bounds nothing.
    scales = [1.0 / bounds[kind] if bounds.get(kind) else 0.0 for kind in kinds]
    return Metric(firsts, np.array(scales))


# What one sample, and what four samples, may be off by, in second differences.
ONE_SAMPLE = np.float32(0.2)
FOUR_SAMPLES = 0.04


@dataclass(frozen=True, eq=False)
class TexelError:
    """Estimates errors in bounds, by `core/second_differences.c`: above 1 is too far off."""

    cells: Cells  # the samples cast so far
    coverage: TexelCoverage
    shape: tuple[int, int]  # height and width of the map
    metric: Metric
    threads: int | None

    def of_samples(self) -> tuple[Float32Array, Float32Array]:
        """Means (n_texels, C) of one sample per texel, and second differences (n_texels,).

        The differences are in bounds, and infinite where too little is known.
        """
        n, n_channels = self.shape[0] * self.shape[1], self.cells.values.shape[1]
        means = np.zeros((n, n_channels), dtype=np.float32)
        own, steps = np.empty((2, n), dtype=np.float32)

        def judge(start: int, stop: int) -> None:
            core.judge_samples(
                *self.shape, start, self.coverage.counts, self.cells.charts, self.cells.values,
                *self.metric, own[start:stop], means[start:stop],
            )  # fmt: skip

        def blend(start: int, stop: int) -> None:
            core.blend_steps(
                *self.shape, start, self.coverage.counts, self.cells.charts, own,
                steps[start:stop],
            )  # fmt: skip

        run_bands(judge, n, band=1 << 16, threads=self.threads)
        run_bands(blend, n, band=1 << 16, threads=self.threads)
        partly = np.flatnonzero(steps < 0.0)
        judged = np.empty(len(partly), dtype=np.float32)

        def judge_partly(start: int, stop: int) -> None:
            core.judge_partly_covered(
                *self.shape, *self.coverage, self.cells.charts, self.cells.values,
                *self.metric, steps, partly[start:stop], judged[start:stop],
            )  # fmt: skip

        run_bands(judge_partly, len(partly), band=1 << 12, threads=self.threads)
        steps[partly] = judged
        return means, steps

    def of_four(self, steps: Float32Array, parents: IntArray, means: Float32Array) -> Float32Array:
        """Errors of texels (n,) with four more samples, whose means (n_texels, C) it writes."""
        errors = np.empty(len(parents), dtype=np.float32)
        cells = self.cells

        def judge(start: int, stop: int) -> None:
            core.judge_four_samples(
                *self.shape, *self.coverage, cells.charts, cells.values, cells.children,
                *self.metric, steps, parents[start:stop], means, errors[start:stop],
            )  # fmt: skip

        run_bands(judge, len(parents), band=1 << 16, threads=self.threads)
        return errors

    def of_cells(self, k: int) -> Float32Array:
        """Estimate errors of the cells of the k-th level, without their children."""
        level = self.cells.levels[k - 1]
        errors = np.empty(len(level), dtype=np.float32)

        def judge(start: int, stop: int) -> None:
            core.judge_cells(
                k, *self.shape, level.first + start,
                level.texels[start:stop], level.spots[start:stop], level.weights[start:stop],
                self.cells.children, self.cells.charts, self.cells.values,
                *self.metric, errors[start:stop],
            )  # fmt: skip

        run_bands(judge, len(errors), band=1 << 16, threads=self.threads)
        return errors

    def divide(
        self, level: Level, k: int, errors: Float32Array, texel_errors: Float32Array
    ) -> BoolArray:
        """Choose cells of the k-th level to divide, and add the errors of the others to texels."""
        divided = np.zeros(len(level), dtype=np.bool_)
        core.choose_divided(
            k < LAST_LEVEL, level.texels, level.weights, errors, self.coverage.counts,
            texel_errors, divided,
        )  # fmt: skip
        return divided

    def of_divided(self) -> Float32Array:
        """Errors (n_texels,) of texels, divided as they are, of the map that is farthest off."""
        cells = self.cells
        means, steps = self.of_samples()
        errors = ONE_SAMPLE * steps
        if not cells.levels:
            return errors
        quarters = cells.levels[0]
        parents = quarters.texels[::4].copy()
        judged = self.of_four(steps, parents, means)
        children = cells.children[quarters.first : quarters.first + len(quarters)]
        is_further = (children.reshape(-1, 4) != NO_CHILD).any(axis=1)
        errors[parents] = np.where(is_further, np.float32(0.0), judged)
        squares = np.zeros(len(errors), dtype=np.float32)
        for k, level in enumerate(cells.levels[1:], start=2):
            of_cells = self.of_cells(k)
            children = cells.children[level.first : level.first + len(level)]
            kept = np.flatnonzero((children == NO_CHILD) & (level.weights > 0))
            texels = level.texels[kept]
            of_kept = level.weights[kept] * of_cells[kept] / self.coverage.counts[texels]
            np.add.at(squares, texels, of_kept**2)
        is_finer = squares > 0.0
        errors[is_finer] = np.sqrt(squares[is_finer])
        return errors


@dataclass(frozen=True, eq=False)
class Refinement:
    """Values and errors of texels once the errors are within bounds."""

    max_error: str  # the bounds
    bounded: list[BoundedMap]  # the maps that they bound
    means: Float32Array  # (n_texels, C) float32; means of texels with up to 4 samples
    # (n_texels,) float32; estimated, in units of the bound, for the map where they are greatest.
    errors: Float32Array
    finest: ByteArray  # (n_texels,) uint8; level of the finest cells of each texel

    def add_means(self, sampler: TexelSampler) -> BoolArray:
        """Write the means of texels with more than 4 samples; return which texels have any."""
        areas = np.zeros(len(self.means), dtype=np.float32)
        sums, cells = np.zeros_like(self.means), sampler.cells
        for level in cells.levels[1:]:
            core.add_leaves(
                level.first, level.texels, level.weights, cells.children, cells.charts,
                cells.values, sums, areas,
            )  # fmt: skip
        texels = np.flatnonzero(areas)
        self.means[texels] = sums[texels] / areas[texels, np.newaxis]
        return np.asarray(areas > 0.0)


def estimate_for(sampler: TexelSampler, bounded: list[BoundedMap]) -> TexelError:
    """Return what estimates the errors of some maps, in their bounds."""
    metric = metric_of(bounded, sampler.kinds)
    return TexelError(sampler.cells, sampler.coverage, sampler.shape, metric, sampler.threads)


def refine(sampler: TexelSampler, bounded: list[BoundedMap], max_error: str) -> Refinement:
    """Divide texels, of which `sampler` has the first samples, until errors are within bounds."""
    stages, estimate = sampler.stages, estimate_for(sampler, bounded)
    with stages.part("estimate errors"):
        means, steps = estimate.of_samples()
        all_errors = ONE_SAMPLE * steps
        finest = np.zeros(len(steps), dtype=np.uint8)
        is_divided = all_errors > 1.0
        texels = in_tiles(is_divided.reshape(sampler.shape))
        # Where four samples would be too few, a texel gets 16 at once.
        is_jump = FOUR_SAMPLES * steps[texels] > 1.0
    level = sampler.divide(texels, np.repeat(~is_jump, 4))
    with stages.part("estimate errors"):
        errors = estimate.of_four(steps, texels, means)
        all_errors[texels], finest[texels] = errors, 1
        is_further = errors > 1.0
        all_errors[texels[is_further]] = 0.0
        divided = np.repeat(is_further, 4) & (level.weights > 0)
    for k in range(2, LAST_LEVEL + 1):
        level = sampler.divide((level.first + np.flatnonzero(divided)).astype(np.int32))
        with stages.part("estimate errors"):
            finest[level.texels] = k
            errors = estimate.of_cells(k)
            divided = estimate.divide(level, k, errors, all_errors)
    return Refinement(max_error, bounded, means, all_errors, finest)
