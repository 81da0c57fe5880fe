"""Texels divided until their estimated errors are within a bound.

Each level of cells is cast whole before it is decided which of them are divided, so the result is
the same for any number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.adaptive_texels.bounded_maps import BoundedMap, metric_of
from texbake.baking.adaptive_texels.cells import (
    LAST_LEVEL,
    BoolArray,
    FloatArray32,
    gather,
    in_tiles,
)
from texbake.baking.adaptive_texels.texel_error import FOUR_SAMPLES, ONE_SAMPLE, TexelError
from texbake.baking.adaptive_texels.texel_sampler import TexelSampler


@dataclass(frozen=True, eq=False)
class Refinement:
    """Values and errors of texels once the errors are within bounds."""

    max_error: str  # the bounds
    bounded: list[BoundedMap]  # the maps that they bound
    means: FloatArray32  # (n_texels, C) float32; means of texels with up to 4 samples
    # (n_texels,) float32; estimated, in units of the bound, for the map where they are greatest.
    errors: FloatArray32
    finest: npt.NDArray[np.uint8]  # (n_texels,) uint8; level of the finest cells of each texel

    def add_means(self, sampler: TexelSampler) -> BoolArray:
        """Write the means of texels with more than 4 samples; return which texels have any."""
        areas = np.zeros(len(self.means), dtype=np.float32)
        sums = np.zeros_like(self.means)
        for level in sampler.cells.levels[1:]:
            gather(sampler.cells, level, sums, areas)
        texels = np.flatnonzero(areas)
        self.means[texels] = sums[texels] / areas[texels, np.newaxis]
        return np.asarray(areas > 0.0)


def estimate_for(sampler: TexelSampler, bounded: list[BoundedMap]) -> TexelError:
    """Return what estimates the errors of some maps, in their bounds."""
    metric = metric_of(bounded, sampler.kinds)
    return TexelError(sampler.cells, sampler.coverage, sampler.shape, metric, sampler.threads)


def refine(sampler: TexelSampler, bounded: list[BoundedMap], max_error: str) -> Refinement:
    """Divide texels until their errors are within bounds.

    `sampler`, with the first samples of all texels, none of which is divided.
    """
    stages, estimate = sampler.stages, estimate_for(sampler, bounded)
    with stages.part("estimate errors"):
        means, steps = estimate.of_samples()
        all_errors = ONE_SAMPLE * steps
        finest = np.zeros(len(steps), dtype=np.uint8)
        is_divided = all_errors > 1.0
        n_divided = int(np.count_nonzero(is_divided))
        texels = in_tiles(is_divided.reshape(sampler.shape), n_divided)
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
