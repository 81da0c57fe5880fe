"""Some texels sampled again, with other and more samples, to see whether estimates can be trusted.

The second samples are 13 per texel, on a Fibonacci lattice. Where values jump they are worth 12
samples on a grid, where they bend 6, so the check has an error of its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.baking.adaptive_texels.cells import BoolArray
from texbake.baking.adaptive_texels.coverage import (
    N_CHECK_SAMPLES,
    CellSamples,
    FaceBins,
    check_samples,
)
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.texels import SampleGrid
from texbake.baking.trace import SampleCaster
from texbake.core import portable_math as pm
from texbake.mesh.mesh import IntArray
from texbake.raycast.rays import NO_HIT
from texbake.sampling.report import generator, n_to_check

IdArray = npt.NDArray[np.int64]

_CHECKS_PER_SIDE = 4  # of a texel: a grid of about as many cells as there are samples


class Recheck:
    """A second bake of one texel in a hundred.

    `has_data` (height * width,) bool: texels to choose from.

    Attributes
    ----------
    texels : (n,) int64
        Row times width plus column, in order.
    n_samples : int
        Number of samples of each.
    """

    n_samples = N_CHECK_SAMPLES

    def __init__(
        self, bins: FaceBins, inputs: BakeInputs, caster: SampleCaster, has_data: BoolArray
    ) -> None:
        self._inputs = inputs
        self.texels = _chosen(np.flatnonzero(has_data))
        samples = check_samples(bins, inputs.options.width_px, self.texels)
        caster = replace(caster, occlusion_range=None)  # no map with a bound needs secondary rays
        size = inputs.options.width_px, inputs.options.height_px
        self._hits, places = _cast(caster, samples, SampleGrid(*size, _CHECKS_PER_SIDE))
        self._ranks = places // self.n_samples

    def differences(self, kind: MapKind, means: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Return how far the means (height * width, C) of a map are from those of the second bake.

        Returns (n,) float64: lengths of the differences, for each texel where the second bake hit
        anything.
        """
        values = kind.values(self._hits, self._inputs)
        n = len(self.texels)
        counts = np.bincount(self._ranks, minlength=n)
        sums = np.stack(
            [np.bincount(self._ranks, values[:, c], minlength=n) for c in range(kind.channels)],
            axis=1,
        )
        has_hit = counts > 0
        second = sums[has_hit] / counts[has_hit, np.newaxis]
        first = means[self.texels[has_hit]].astype(np.float64)
        if kind.combine == "unit mean":
            second, first = _units(second), _units(first)
        return np.asarray(pm.norm(second - first, axis=1))


def _cast(caster: SampleCaster, samples: CellSamples, grid: SampleGrid) -> tuple[Hits, IntArray]:
    """Cast samples; return the hits, and the places of their samples."""
    hits = caster.cast(samples.samples, grid)
    is_hit = hits.high_faces != NO_HIT
    return hits.where(is_hit), samples.places[is_hit]


def _chosen(candidates: IdArray) -> IdArray:
    """Draw texels at random."""
    # Several times faster than drawing without repetition; a few texels fewer are drawn.
    n = len(candidates)
    places = np.unique(generator().integers(0, max(n, 1), n_to_check(n)))
    chosen: IdArray = candidates[places]
    return chosen


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    lengths = pm.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
