"""The slow reference: 256 bilinear lookups over the parallelogram that a pixel covers.

It reads the finest level alone, so that it shares nothing with filters that read smaller ones, and
gives all lookups the same weight, as a square pixel does. They lie on a lattice of rank 1, whose
points all differ in both coordinates: the rows of a regular grid of 16 by 16 would fall on the same
phase of a regular texture over and over.

Based on: Korobov, "The Approximate Computation of Multiple Integrals", 1959, for the lattice;
Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, for the parallelogram. The
multiplier was chosen among all odd ones for small errors over waves of up to 40 periods a pixel.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.lookup import between, cell_at, folded

_N_SAMPLES = 256
_MULTIPLIER = 111

_STEPS = np.arange(_N_SAMPLES) + 0.5
# (256, 2) points of [-1/2, 1/2]², as many to either side of the middle, and as far.
SAMPLES = np.stack([_STEPS, _MULTIPLIER * _STEPS % _N_SAMPLES], axis=1) / _N_SAMPLES - 0.5
SAMPLES.flags.writeable = False


@kernel
def supersampled_kernel(  # type: ignore[no-untyped-def]
    texels, offsets, sizes, uvs, derivatives, samples, wrap, border, out, start, stop
):  # fmt: skip
    """Fill rows `start` to `stop` of `out`."""
    n_channels = texels.shape[1]
    height, width = sizes[0]
    sums = np.empty(n_channels)
    for i in range(start, stop):
        for channel in range(n_channels):
            sums[channel] = 0.0
        for k in range(len(samples)):
            right, down = samples[k]
            u = uvs[i, 0] + right * derivatives[i, 0] + down * derivatives[i, 2]
            v = uvs[i, 1] + right * derivatives[i, 1] + down * derivatives[i, 3]
            cell, x, y = cell_at(folded(u, wrap), folded(v, wrap), width, height, wrap, offsets[0])
            for channel in range(n_channels):
                sums[channel] += between(texels, cell, x, y, channel, border[channel])
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / len(samples)
