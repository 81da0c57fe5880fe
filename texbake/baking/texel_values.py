"""From hits to maps: samples of each texel, summed up, denoised, and padded around the charts.

The value of a texel is the mean of its hits, or the first of them. Padding is a dilation from the
nearest texel, then a smooth fill.

A texel whose rays missed keeps the neutral value of the map, and is neither a source nor a target
of padding or fill. Only colors are continued into misses, where a black spot would be worse.
Kernel: `core/texel_sums.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.result import BakedMap
from texbake.baking.texels import NO_FACE
from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, Int64Array, IntArray
from texbake.parallel import run_bands
from texbake.progress import Stages
from texbake.texture.padding import nearest_owner, push_pull

if TYPE_CHECKING:
    from texbake.baking.texture.options import TextureBakeOptions


# Hits whose values for a map stay in a processor's cache until they are added.
_HITS_PER_BAND = 1 << 15
# Texels per band: a few milliseconds of work.
_BAND = 1 << 18
# Hits that are made into maps at once, if the high-poly mesh is streamed: the faces that they hit
# are in memory.
_HITS_OF_STREAM = 1 << 21
# As in `core/texel_sums.c`.
_MODES = {"mean": 0, "unit mean": 1, "first": 2}


class TexelSums:
    """Adds up the samples of each texel, for several maps at once."""

    def __init__(self, kinds: list[MapKind], inputs: BakeInputs) -> None:
        n_texels = inputs.options.width_px * inputs.options.height_px
        self._inputs = inputs
        self._sums = {kind: np.zeros((n_texels, kind.channels), dtype=np.float32) for kind in kinds}
        self.n_hits = np.zeros(n_texels, dtype=np.uint8)  # samples of each texel that hit
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
        if options.samples == 1 and not inputs.has_samplers:
            run_bands(add, len(hits), band=_HITS_PER_BAND, threads=options.threads)
        else:  # bands share texels, or samplers are called, one band at a time
            run_bands(add, len(hits), band=_BAND, threads=1)

    def place(self, means: dict[MapKind, Float32Array], has_data: BoolArray) -> None:
        """Set the means of texels (height * width, channels) instead of adding samples."""
        self._sums = means
        self.n_hits = has_data.astype(np.uint8)
        self._n_samples = self.n_hits

    def means(self, kind: MapKind) -> Float32Array:
        """(height, width, channels) values, neutral without hits; may be called once per map."""
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

        run_bands(divide, len(sums), band=_BAND, threads=options.threads)
        return sums.reshape(shape)

    def _add_values(
        self, hits: Hits, kinds: list[MapKind], counts: ByteArray, inputs: BakeInputs
    ) -> None:
        """Add samples to maps, then count them."""
        for kind in kinds:
            values = kind.values(hits, inputs)
            if kind.combine == "first":
                core.keep_first_samples(hits.texel_ids, values, counts, self._sums[kind])
            else:
                core.add_samples(hits.texel_ids, values, self._sums[kind])
        core.count_samples(hits.texel_ids, counts)


class ChartPadding:
    """Pads and fills around charts (H, W) of several maps, by nearest texels found once."""

    def __init__(
        self, texel_charts: IntArray, has_data: BoolArray, options: BakeOptions | TextureBakeOptions
    ) -> None:
        is_free = texel_charts < 0
        missed = ~(is_free | has_data)
        self._missed = np.flatnonzero(missed)
        self.n_missed = len(self._missed)  # covered texels without a hit
        self._options = options
        self._has_data = has_data
        self._valid = has_data  # sources of the fill
        # Texels of the padding, and the texel from which each one takes its value.
        self._targets: Int64Array = np.zeros(0, dtype=np.int64)
        self._sources: IntArray = np.zeros(0, dtype=np.int32)
        self.n_meeting = 0  # texels where the padding of two charts meets
        if options.padding > 0:
            sources = texel_charts
            if self.n_missed:
                sources = np.where(missed, np.int32(NO_FACE), texel_charts)
            owners = nearest_owner(sources, options.padding, threads=options.threads)
            self.n_meeting = owners.n_meeting
            has_owner = owners.indices >= 0
            if options.fill == "push-pull":
                self._valid = has_owner & ~missed
            has_owner &= is_free
            self._targets = np.flatnonzero(has_owner).astype(np.int64, copy=False)
            self._sources = owners.indices.ravel()[self._targets]

    def pad(
        self,
        values: Float32Array,
        neutral: tuple[float, ...],
        combine: str = "mean",
        *,
        hides_misses: bool = False,
    ) -> Float32Array:
        """Pad and fill a map (H, W, C), in place where possible; misses if `hides_misses`."""
        threads = self._options.threads
        texels = values.reshape(-1, values.shape[2])
        nothing = np.array(neutral, np.float32)
        kernel = partial(core.copy_texels, texels, self._targets, self._sources, nothing)
        run_bands(kernel, len(self._targets), band=_BAND, threads=threads)
        if self._options.fill == "push-pull" and combine != "first":
            values = push_pull(values, self._valid, threads=threads)
            if combine == "unit mean":
                _normalize(values, ~self._valid)
        if self.n_missed:
            around: Float32Array | tuple[float, ...] = neutral
            if hides_misses and self._has_data.any():
                filled = push_pull(values, self._has_data, threads=threads)
                around = filled.reshape(-1, values.shape[2])[self._missed]
            values.reshape(-1, values.shape[2])[self._missed] = around
        return values


def _normalize(values: Float32Array, chosen: BoolArray) -> None:
    """Normalize the chosen vectors in place; zero vectors stay zero."""
    vectors = values[chosen]
    lengths = np.sqrt(pm.vecdot(vectors, vectors))
    lengths[lengths == 0.0] = 1.0
    values[chosen] = vectors / lengths[:, np.newaxis]


_ROWS = 128
# In standard errors: two values with independent errors differ by more than this 1 time in 700.
_STANDARD_ERRORS = 4.5


def denoised(
    values: Float32Array,
    kind: MapKind,
    texel_charts: IntArray,
    has_data: BoolArray,
    options: BakeOptions,
) -> Float32Array:
    """Average texels (H, W, 1) with similar neighbors in their chart; `core/sigma_filter.c`."""
    root = np.sqrt(float(options.secondary_rays))
    left = _STANDARD_ERRORS / (root * np.sqrt(root))
    of_shares, relative = (left * noise for noise in kind.noise)
    flat, filtered = values[..., 0].copy(), np.empty_like(values[..., 0])

    def work(start: int, stop: int) -> None:
        core.filter_by_noise(
            flat, texel_charts, has_data, of_shares, relative, start, stop, filtered
        )

    run_bands(work, len(values), band=_ROWS, threads=options.threads)
    return filtered[..., np.newaxis]


def finished_maps(
    kinds: list[MapKind],
    means: Callable[[MapKind], Float32Array],
    texel_charts: IntArray,
    has_data: BoolArray,
    inputs: BakeInputs,
    stages: Stages,
) -> tuple[dict[str, BakedMap], int]:
    """Pad maps, whose `means` change in place; count texels where padding of charts meets."""
    options = inputs.options
    with stages.stage("pad"):
        padding = ChartPadding(texel_charts, has_data, options)
        complete = padding
        if any(kind.of_misses for kind in kinds) and padding.n_missed:
            complete = ChartPadding(texel_charts, texel_charts != NO_FACE, options)
    maps = {}
    for kind in kinds:
        with stages.part("make maps"):
            values = means(kind)
            if options.denoise and any(kind.noise):
                values = denoised(values, kind, texel_charts, has_data, options)
        with stages.part("pad"):
            around = complete if kind.of_misses else padding
            values = around.pad(
                values, kind.neutral(options), kind.combine, hides_misses=kind.hides_misses
            )
        bounds = inputs.bounds if kind.coding == "position" else None
        maps[kind.name] = BakedMap(kind, values, has_data, options, bounds, kind.legend(inputs))
    return maps, padding.n_meeting
