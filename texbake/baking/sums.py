"""The values of texels from those of their samples: the mean of the hits, or the first of them.

Kernel: `core/texel_sums.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.core import core
from texbake.parallel import run_bands

BoolArray = npt.NDArray[np.bool_]

# Hits whose values for a map stay in a processor's cache until they are added.
_BAND = 1 << 15
_SHARING_BAND = 1 << 18
# Hits that are made into maps at once, if the high-poly mesh is streamed: the faces that they hit
# are in memory.
_HITS_OF_STREAM = 1 << 21
# As in `core/texel_sums.c`.
_MODES = {"mean": 0, "unit mean": 1, "first": 2}


class TexelSums:
    """Adds up the samples of each texel, for several maps at once.

    Attributes
    ----------
    n_hits : (height * width,) uint8
        Number of samples of each texel that hit.
    """

    def __init__(self, kinds: list[MapKind], inputs: BakeInputs) -> None:
        n_texels = inputs.options.width_px * inputs.options.height_px
        self._inputs = inputs
        self._sums = {kind: np.zeros((n_texels, kind.channels), dtype=np.float32) for kind in kinds}
        self.n_hits = np.zeros(n_texels, dtype=np.uint8)
        # Number of samples of each texel, hits and misses, if a map counts misses.
        self._n_samples = None
        if any(kind.of_misses for kind in kinds):
            self._n_samples = np.zeros(n_texels, dtype=np.uint8)

    def add(self, hits: Hits) -> None:
        """Add the hits of a trace, and its misses to maps that count them."""
        if self._inputs.stream is None:
            self._add(hits, self._inputs)
            return
        for start in range(0, len(hits), _HITS_OF_STREAM):
            inputs, some = self._inputs.of_hits(hits.where(slice(start, start + _HITS_OF_STREAM)))
            self._add(some, inputs)

    def _add(self, hits: Hits, inputs: BakeInputs) -> None:
        of_misses = [kind for kind in self._sums if kind.of_misses]
        of_hits = [kind for kind in self._sums if not kind.of_misses]
        for kind in self._sums:  # what the bands share is computed here, on all threads
            kind.values(hits.where(slice(0)), inputs)

        def add(start: int, stop: int) -> None:
            band = hits.where(slice(start, stop))
            if self._n_samples is not None:
                self._add_values(band, of_misses, self._n_samples, inputs)
            is_hit = band.is_hit
            if not is_hit.all():
                band = band.where(is_hit)
            self._add_values(band, of_hits, self.n_hits, inputs)

        options = self._inputs.options
        if options.samples == 1:
            run_bands(add, len(hits), band=_BAND, threads=options.threads)
        else:  # bands share texels, so that only the values of each are computed on all threads
            run_bands(add, len(hits), band=_SHARING_BAND, threads=1)

    def place(self, means: dict[MapKind, npt.NDArray[np.float32]], has_data: BoolArray) -> None:
        """Set the means of texels (height * width, channels) instead of adding samples."""
        self._sums = means
        self.n_hits = has_data.astype(np.uint8)
        self._n_samples = self.n_hits

    def means(self, kind: MapKind) -> npt.NDArray[np.float32]:
        """(height, width, channels) float32: values of hits, and the neutral value elsewhere.

        `MapKind.combine` determines how samples are combined. The sums are overwritten, so that
        this can be called once for each map.
        """
        options = self._inputs.options
        sums = self._sums.pop(kind)
        shape = (options.height_px, options.width_px, kind.channels)
        neutral = np.array(kind.neutral(options), dtype=np.float32)
        if options.samples == 1 and kind.combine != "unit mean" and not neutral.any():
            return sums.reshape(shape)  # texels without a value are 0, which is neutral
        counts = self.n_hits
        if kind.of_misses and self._n_samples is not None:
            counts = self._n_samples
        mode = _MODES[kind.combine]

        def divide(start: int, stop: int) -> None:
            core.combine_samples(sums[start:stop], counts[start:stop], neutral, mode)

        run_bands(divide, len(sums), band=_SHARING_BAND, threads=options.threads)
        return sums.reshape(shape)

    def _add_values(
        self,
        hits: Hits,
        kinds: list[MapKind],
        counts: npt.NDArray[np.uint8],
        inputs: BakeInputs,
    ) -> None:
        """Add samples to maps, then count them."""
        for kind in kinds:
            values = kind.values(hits, inputs)
            if kind.combine == "first":
                core.keep_first_samples(hits.texel_ids, values, counts, self._sums[kind])
            else:
                core.add_samples(hits.texel_ids, values, self._sums[kind])
        core.count_samples(hits.texel_ids, counts)
