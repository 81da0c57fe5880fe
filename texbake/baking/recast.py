"""Some texels once more, with other and more samples: whether estimated errors can be believed.

The second cast has 13 samples a texel, on a Fibonacci lattice, none of which is one of the first
cast's. That is several times what most texels had. For the mean over a leap they are worth 12 in a
grid, over a bend 6, so that what is measured has an error of its own.

Based on: Sloan, Joe, "Lattice Methods for Multiple Integration", Oxford 1994, section 4.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.baking.coverage import TEXEL, FaceBins, owner_at
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.texels import NO_FACE, Samples, write_weights
from texbake.baking.trace import Casts
from texbake.kernels import kernel
from texbake.raycast.rays import NO_HIT

N_SAMPLES, _GENERATOR = 13, 8  # Fibonacci numbers, one after the other
_SHARE = 0.01  # of the texels
_SEED = 5

BoolArray = npt.NDArray[np.bool_]
IdArray = npt.NDArray[np.int64]


class Recast:
    """A second cast of one texel of a hundred, chosen at random, always the same.

    Parameters
    ----------
    bins : FaceBins
        Of the light mesh.
    has_data : (height * width,) bool
        The texels to choose from.

    Attributes
    ----------
    texels : (n,) int64
        Row times width plus column, in order.
    n_samples : int
        Of each.
    """

    n_samples = N_SAMPLES

    def __init__(
        self, bins: FaceBins, inputs: BakeInputs, casts: Casts, has_data: BoolArray
    ) -> None:
        self._inputs = inputs
        self.texels = _chosen(np.flatnonzero(has_data))
        samples = self._samples(bins)
        casts = replace(casts, reach=None)  # no map with a bound needs secondary rays
        hits, lost = casts.look(samples)
        parts = [hits]
        if lost is not None:
            parts.append(casts.look_again([lost]))
        hits = Hits.joined(parts)
        self._hits = hits.where(hits.high_faces != NO_HIT)

    def differences(self, kind: MapKind, means: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Lengths of the differences of a map's means (height * width, C) to those of this cast.

        One for each texel of which this cast hit anything.
        """
        values = kind.values(self._hits, self._inputs)
        places = self._hits.texel_ids // self.n_samples
        n = len(self.texels)
        counts = np.bincount(places, minlength=n)
        sums = np.stack(
            [np.bincount(places, values[:, c], minlength=n) for c in range(kind.channels)], axis=1
        )
        found = counts > 0
        mine = sums[found] / counts[found, np.newaxis]
        theirs = means[self.texels[found]].astype(np.float64)
        if kind.combine == "unit mean":
            mine, theirs = _units(mine), _units(theirs)
        return np.asarray(np.linalg.norm(mine - theirs, axis=1))

    def _samples(self, bins: FaceBins) -> Samples:
        """The owned samples; their texel ids are places among all samples of the texels."""
        n = len(self.texels) * self.n_samples
        owners, weights = np.empty(n, dtype=np.int32), np.empty((n, 2))
        _samples_kernel(bins.arrays, self._inputs.options.width_px, self.texels, owners, weights)
        samples = Samples(np.arange(n, dtype=np.int32), owners, weights)
        return samples.where(owners != NO_FACE)


def _chosen(candidates: IdArray) -> IdArray:
    """Some of them."""
    rng = np.random.default_rng(_SEED)
    n_wanted = int(np.ceil(_SHARE * len(candidates)))
    # Several times quicker than a choice without repeats; a few texels less are chosen.
    places = np.unique(rng.integers(0, max(len(candidates), 1), n_wanted))
    return candidates[places]


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


@kernel
def _samples_kernel(bins, width, texels, owners, weights):  # type: ignore[no-untyped-def]
    i = 0
    for texel in texels:
        for sample in range(N_SAMPLES):
            across, down = sample, _GENERATOR * sample % N_SAMPLES
            x = (texel % width) * TEXEL + (2 * across + 1) * TEXEL // (2 * N_SAMPLES)
            y = (texel // width) * TEXEL + (2 * down + 1) * TEXEL // (2 * N_SAMPLES)
            owners[i] = owner_at(bins, x, y)
            if owners[i] != NO_FACE:
                write_weights(bins[0], owners[i], x, y, weights[i])
            i += 1
