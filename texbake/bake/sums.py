"""Values of samples to values of texels: the mean of the vectors that hit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.bake.hits import NO_HIT, Hits
from texbake.bake.inputs import BakeInputs
from texbake.bake.maps.kind import MapKind
from texbake.kernels import kernel
from texbake.parallel import run_bands

BoolArray = npt.NDArray[np.bool_]

_BAND = 1 << 18


class TexelSums:
    """Adds up the hits of a bake, texel by texel, for several maps at once.

    Attributes
    ----------
    n_hits : (height * width,) uint8
        Samples of each texel that hit.
    """

    def __init__(self, kinds: list[MapKind], inputs: BakeInputs) -> None:
        n_texels = inputs.options.width_px * inputs.options.height_px
        self._inputs = inputs
        self._sums = {kind: np.zeros((n_texels, kind.channels), dtype=np.float32) for kind in kinds}
        self.n_hits = np.zeros(n_texels, dtype=np.uint8)

    def add(self, hits: Hits) -> None:
        """Add the hits of a trace; its misses add nothing."""
        is_hit = hits.high_faces != NO_HIT
        if not is_hit.all():
            hits = hits.where(is_hit)
        options = self._inputs.options
        # Only with one sample a texel can no two bands meet in a texel.
        band = _BAND if options.samples == 1 else max(len(hits), 1)
        values = {kind: kind.values(hits, self._inputs) for kind in self._sums}

        def add(start: int, stop: int) -> None:
            texel_ids = hits.texel_ids[start:stop]
            for kind, sums in self._sums.items():
                _add_kernel(texel_ids, values[kind][start:stop], sums)
            _count_kernel(texel_ids, self.n_hits)

        run_bands(add, len(hits), band=band, threads=options.threads)

    def place(self, means: dict[MapKind, npt.NDArray[np.float32]], has_data: BoolArray) -> None:
        """Take means of texels (height * width, channels) that were made elsewhere."""
        self._sums = means
        self.n_hits = has_data.astype(np.uint8)

    def means(self, kind: MapKind) -> npt.NDArray[np.float32]:
        """(height, width, channels) float32: means of what hit, the neutral value elsewhere.

        Means of normals are normalized. It uses the sums up: ask once for each map.
        """
        options = self._inputs.options
        sums = self._sums.pop(kind)
        neutral = np.array(kind.neutral(options), dtype=np.float32)
        is_normal = kind.coding == "normal"

        def divide(start: int, stop: int) -> None:
            _mean_kernel(sums[start:stop], self.n_hits[start:stop], neutral, is_normal)

        run_bands(divide, len(sums), band=_BAND, threads=options.threads)
        return sums.reshape(options.height_px, options.width_px, kind.channels)


@kernel
def _add_kernel(texel_ids, values, sums):  # type: ignore[no-untyped-def]
    for i in range(len(texel_ids)):
        for channel in range(values.shape[1]):
            sums[texel_ids[i], channel] += values[i, channel]


@kernel
def _count_kernel(texel_ids, counts):  # type: ignore[no-untyped-def]
    for texel in texel_ids:
        counts[texel] += 1


@kernel
def _mean_kernel(sums, counts, neutral, normalize):  # type: ignore[no-untyped-def]
    n_channels = sums.shape[1]
    for i in range(len(sums)):
        divisor = float(counts[i])
        if normalize and divisor > 0.0:
            square = 0.0
            for channel in range(n_channels):
                square += float(sums[i, channel]) * float(sums[i, channel])
            divisor = np.sqrt(square)
        for channel in range(n_channels):
            if divisor > 0.0:
                sums[i, channel] = sums[i, channel] / divisor
            else:
                sums[i, channel] = neutral[channel]
