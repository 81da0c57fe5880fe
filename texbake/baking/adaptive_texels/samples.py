"""A bake with adaptive samples: one per texel, and more where neighboring ones disagree.

Samples are added until the errors are within a bound, or while there is time for a tighter one.

At the end some texels are baked a second time, with 13 samples each on a Fibonacci lattice, worth 6
to 12 on a grid, to see whether the estimated errors can be trusted.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from texbake.baking.adaptive_texels.coverage import N_CHECK_SAMPLES, check_samples
from texbake.baking.adaptive_texels.texel_error import (
    BoundedMap,
    Refinement,
    bounded_maps,
    estimate_for,
    refine,
)
from texbake.baking.adaptive_texels.texel_rounds import TexelRounds
from texbake.baking.adaptive_texels.texel_sampler import LAST_LEVEL, NO_CHART, TexelSampler
from texbake.baking.maps import MapKind
from texbake.baking.report import DistanceSummary
from texbake.baking.texel_values import TexelSums
from texbake.baking.texels import SampleGrid
from texbake.baking.trace import Trace
from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray
from texbake.records import dataclass
from texbake.sampling.report import (
    SamplingReport,
    check_random,
    format_percents,
    n_to_check,
    percent_within,
)
from texbake.sampling.rounds import BudgetClock, TimeBudget


@dataclass(frozen=True, kw_only=True)
class BakeSampling(SamplingReport):
    """What the adaptive samples of a bake achieved; divided texels count by their finest."""

    rays_per_texel: float  # rays cast for the maps, per texel with data
    rays_of_check: int  # rays cast for the check
    unbounded: tuple[str, ...] = ()  # maps without a bound, made from the samples of the others

    element: ClassVar[str] = "texel"
    most_samples: ClassVar[int] = 64

    @property
    def warnings(self) -> list[str]:
        """One if 64 samples were too few for many texels, and one if a map has no bound."""
        if not self.unbounded:
            return super().warnings
        names = ", ".join(self.unbounded)
        return [
            f"{self.max_error} bounds nothing of {names}: what the other maps need decides on its "
            "samples, whatever its own errors are",
            *super().warnings,
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        samples = (
            f"{format_percents(self.sample_percents)}; {self.rays_per_texel:.2f} rays per texel"
        )
        return [("samples per texel", samples), *super().table()]


def cast_adaptively(
    sums: TexelSums, trace: Trace, distances: DistanceSummary, clock: BudgetClock
) -> tuple[BakeSampling, TimeBudget | None]:
    """Cast all samples, give the means of texels to `sums`, and check some of them."""
    options, stages = trace.options, trace.stages
    bounded = bounded_maps(trace.setup.kinds, trace.setup.inputs, options.error_bounds)
    sampler = TexelSampler(trace, distances)
    budget: TimeBudget | None = None
    if options.time_budget is None:
        sampler.cast_texels()
        refined = refine(sampler, bounded, str(options.error_bounds))
    else:
        refined, budget = TexelRounds(sampler, options, clock).run()
    has_data = sampler.cells.charts[: len(refined.means)] != NO_CHART
    with stages.part("make maps"):
        has_data |= refined.add_means(sampler)
        means = {
            kind: sampler.cells.firsts(len(refined.means), channels)
            if kind.combine == "first"
            else np.ascontiguousarray(refined.means[:, channels])
            for kind, channels in sampler.channels()
        }
        sums.place(means, has_data)
    with stages.stage("check errors"):
        return _report(sampler, refined, means, has_data), budget


def _report(
    sampler: TexelSampler,
    refined: Refinement,
    means: dict[MapKind, Float32Array],
    has_data: BoolArray,
) -> BakeSampling:
    counts = sampler.trace.counts
    n_covered = max(int(np.count_nonzero(has_data)), 1)
    n_rays = counts.rays_cast
    finest = np.bincount(refined.finest[has_data], minlength=LAST_LEVEL + 1)
    recheck = ValidationBake(sampler, has_data)
    errors = tuple(
        item.summary(
            _errors_of(item, sampler, refined)[has_data],
            recheck.differences(item.kind, means[item.kind]),
        )
        for item in refined.bounded
    )
    bounded = {item.kind for item in refined.bounded}
    return BakeSampling(
        max_error=refined.max_error,
        sample_percents={4**k: 100.0 * n / n_covered for k, n in enumerate(finest.tolist())},
        within_percent=percent_within(refined.errors[has_data], 1.0),
        n_checked=len(recheck.texels),
        samples_of_check=N_CHECK_SAMPLES,
        errors=errors,
        rays_per_texel=n_rays / n_covered,
        rays_of_check=counts.rays_cast - n_rays,
        unbounded=tuple(kind.name for kind in sampler.kinds if kind not in bounded),
    )


def _errors_of(item: BoundedMap, sampler: TexelSampler, refined: Refinement) -> Float32Array:
    """Estimated errors of one map, in its bound."""
    if len(refined.bounded) == 1:
        return refined.errors
    return estimate_for(sampler, [item]).of_divided()


_CHECKS_PER_SIDE = 4  # of a texel: a grid of about as many cells as there are samples


class ValidationBake:
    """A second bake of one texel in a hundred, drawn from those that have data."""

    def __init__(self, sampler: TexelSampler, has_data: BoolArray) -> None:
        self._inputs = sampler.inputs
        candidates = np.flatnonzero(has_data)
        # Several times faster than drawing without repetition; a few texels fewer are drawn.
        n = len(candidates)
        self.texels = candidates[np.unique(check_random().integers(0, max(n, 1), n_to_check(n)))]
        height, width = sampler.shape
        ranks, samples = check_samples(sampler.bins, width, self.texels)
        # No map with a bound needs secondary rays.
        grid = SampleGrid(width, height, _CHECKS_PER_SIDE)
        hits = sampler.trace.cast(samples, grid, with_secondary=False)
        self._hits = hits.where(hits.is_hit)
        self._ranks = ranks[hits.is_hit]

    def differences(self, kind: MapKind, means: Float32Array) -> FloatArray:
        """(n,) distances of means (height * width, C) from the second bake, where that hit."""
        values = kind.values(self._hits, self._inputs)
        n = len(self.texels)
        counts = np.bincount(self._ranks, minlength=n)
        sums = np.stack([np.bincount(self._ranks, column, n) for column in values.T], axis=1)
        has_hit = counts > 0
        second = sums[has_hit] / counts[has_hit, np.newaxis]
        first = means[self.texels[has_hit]].astype(np.float64)
        if kind.combine == "unit mean":
            second, first = _units(second), _units(first)
        return np.asarray(pm.norm(second - first, axis=1))


def _units(vectors: FloatArray) -> FloatArray:
    lengths = pm.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
