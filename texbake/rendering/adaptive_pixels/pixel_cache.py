"""What pixels gave with each number of samples, so that none is sampled twice in the same way.

A picture that is refined to one bound after another begins anew with each, and its pixels then pass
through the same samples again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.adaptive_pixels.pixel_sums import Float32Array, PixelSums
from texbake.rendering.adaptive_pixels.sampler import BoolArray, PixelSampler, Sides

PixelIds = npt.NDArray[np.int64]


class PixelCache:
    """Samples pixels, or returns what they gave before.

    `shape` (int, int).
    """

    def __init__(self, sampler: PixelSampler, shape: tuple[int, int]) -> None:
        self._sampler, self._n_pixels = sampler, shape[0] * shape[1]
        self._rows: dict[Sides, IntArray] = {}  # of each pixel among the kept ones, or -1
        self._kept: dict[Sides, tuple[FloatArray, FloatArray, Float32Array]] = {}

    def take(self, wanted: BoolArray, sides: Sides, sums: PixelSums) -> None:
        """Do as `PixelSampler.take` does."""
        if sides not in self._rows:
            self._rows[sides] = np.full(self._n_pixels, -1, dtype=np.int32)
            self._kept[sides] = np.empty((0, 4)), np.empty((0, 4)), np.empty(0, np.float32)
        pixels = np.flatnonzero(wanted)
        is_new = self._rows[sides][pixels] < 0
        self._put(pixels[~is_new], sides, sums)
        if is_new.any():
            new = np.zeros(self._n_pixels, np.bool_)
            new[pixels[is_new]] = True
            self._sampler.take(new.reshape(wanted.shape), sides, sums)
            self._keep(pixels[is_new], sides, sums)

    def _put(self, pixels: PixelIds, sides: Sides, sums: PixelSums) -> None:
        """Write the sums of some pixels that are kept."""
        rows = self._rows[sides][pixels]
        light, squares, covered = self._kept[sides]
        sums.light.reshape(-1, 4)[pixels] = light[rows]
        sums.squares.reshape(-1, 4)[pixels] = squares[rows]
        sums.covered.reshape(-1)[pixels] = covered[rows]
        sums.counts.reshape(-1)[pixels] = sides.seen**2

    def _keep(self, pixels: PixelIds, sides: Sides, sums: PixelSums) -> None:
        light, squares, covered = self._kept[sides]
        self._rows[sides][pixels] = np.arange(len(light), len(light) + len(pixels), dtype=np.int32)
        self._kept[sides] = (
            np.concatenate([light, sums.light.reshape(-1, 4)[pixels]]),
            np.concatenate([squares, sums.squares.reshape(-1, 4)[pixels]]),
            np.concatenate([covered, sums.covered.reshape(-1)[pixels]]),
        )
