"""A bake with adaptive samples: one per texel, and more where neighboring ones disagree.

Samples are added until the errors are within a bound, or while there is time for a tighter one.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.adaptive_texels.bounded_maps import BakeSampling, BoundedMap, bounded_maps
from texbake.baking.adaptive_texels.cells import LAST_LEVEL, NO_CHART, BoolArray, FloatArray32
from texbake.baking.adaptive_texels.recheck import Recheck
from texbake.baking.adaptive_texels.refinement import Refinement, estimate_for, refine
from texbake.baking.adaptive_texels.texel_rounds import TexelRounds
from texbake.baking.adaptive_texels.texel_sampler import TexelSampler
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.report import DistanceSummary
from texbake.baking.sums import TexelSums
from texbake.baking.trace import Trace
from texbake.progress import Stages
from texbake.sampling.report import percent_within
from texbake.sampling.time_budget import BudgetClock, TimeBudget


def cast_adaptively(
    sums: TexelSums,
    kinds: list[MapKind],
    trace: Trace,
    inputs: BakeInputs,
    stages: Stages,
    distances: DistanceSummary,
    clock: BudgetClock | None = None,
) -> tuple[BakeSampling, TimeBudget | None]:
    """Cast all samples, give the means of texels to `sums`, and check some of them."""
    options = inputs.options
    bounded = bounded_maps(kinds, inputs, options.error_bounds)
    with trace.casting() as caster:
        sampler = TexelSampler(kinds, trace, inputs, stages, distances, caster)
        budget: TimeBudget | None = None
        if options.time_budget is None:
            sampler.cast_texels()
            refined = refine(sampler, bounded, str(options.error_bounds))
        else:
            refined, budget = TexelRounds(sampler, options, clock or BudgetClock()).spend()
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
    means: dict[MapKind, FloatArray32],
    has_data: BoolArray,
) -> BakeSampling:
    counts = sampler.trace.counts
    n_covered = max(int(np.count_nonzero(has_data)), 1)
    n_rays = counts.rays_cast
    finest = np.bincount(refined.finest[has_data], minlength=LAST_LEVEL + 1)
    recheck = Recheck(sampler.bins, sampler.inputs, sampler.caster, has_data)
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
        samples_of_check=recheck.n_samples,
        errors=errors,
        rays_per_texel=n_rays / n_covered,
        rays_of_check=counts.rays_cast - n_rays,
        unbounded=tuple(kind.name for kind in sampler.kinds if kind not in bounded),
    )


def _errors_of(item: BoundedMap, sampler: TexelSampler, refined: Refinement) -> FloatArray32:
    """Estimated errors of one map, in its bound."""
    if len(refined.bounded) == 1:
        return refined.errors
    return estimate_for(sampler, [item]).of_divided()
