"""Some pixels of a picture once more, with other and more samples: whether errors can be believed.

The second look has `SIDE` x `SIDE` samples a pixel, each of them shaded. That is an odd number, so
that but for the very middle none of them is one of the first's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.rendering.picture_error import CODES
from texbake.rendering.picture_report import PictureSampling
from texbake.rendering.pixel_errors import code_means
from texbake.rendering.pixel_samples import BoolArray, Sides
from texbake.rendering.pixel_sums import Float32Array, PixelSums

if TYPE_CHECKING:
    from texbake.rendering.adaptive import AdaptivePicture

SIDE = 15
SHARE = 0.01  # of the pixels that show a surface
# They are taken from this many times as many, which lie in runs of rows: few need be rasterized.
AMONG = 10
RUN = 4
_SEED = 5
_PERCENTILES = (50, 99, 100)


def second_look(adaptive: AdaptivePicture, bound: float | None) -> PictureSampling:
    """Sample one pixel of a hundred again, always the same ones, and tell what was reached.

    Parameters
    ----------
    adaptive
        A picture that is finished.
    bound
        As asked for, of sRGB-coded channels from black to white 1; None for none.
    """
    sampler, sums, errors = adaptive.sampler, adaptive.sums, adaptive.errors()
    shows = sums.covered > 0.0
    n_pixels = int(np.count_nonzero(shows))
    n_shaded = sampler.n_shaded
    chosen = _chosen(shows)
    again = PixelSums.empty(*shows.shape)
    sampler.take(chosen, Sides(SIDE, SIDE), again)
    codes = np.zeros_like(adaptive.codes)
    code_means(again, codes, threads=adaptive.threads)
    apart = np.abs(adaptive.codes[chosen] - codes[chosen]).max(axis=-1)
    return PictureSampling(
        max_error=None if bound is None else CODES * bound,
        shaded_percents=_percents(adaptive.shaded[shows] ** 2),
        seen_percents=_percents(sums.counts[shows]),
        shadings_per_pixel=n_shaded / max(n_pixels, 1),
        within_percent=_percent_within(errors[shows], bound),
        estimated=_percentiles(errors[shows]),
        pixels_checked=len(apart),
        samples_of_check=SIDE**2,
        measured=_percentiles(apart),
        measured_within_percent=_percent_within(apart, bound),
    )


def _chosen(shows: BoolArray) -> BoolArray:
    """(H, W) bool: some pixels, out of runs of rows that are chosen first."""
    rng = np.random.default_rng(_SEED)
    by_row = np.count_nonzero(shows, axis=1)
    runs = np.add.reduceat(by_row, np.arange(0, len(by_row), RUN))
    n_wanted = int(np.ceil(SHARE * by_row.sum()))
    order = rng.permutation(len(runs))
    n_runs = 1 + int(np.searchsorted(np.cumsum(runs[order]), AMONG * n_wanted))
    among = np.zeros(len(runs), np.bool_)
    among[order[:n_runs]] = True
    rows = np.repeat(among, RUN)[: len(by_row)]
    candidates = np.flatnonzero((shows & rows[:, None]).ravel())
    chosen = np.zeros(shows.size, np.bool_)
    chosen[rng.choice(candidates, min(n_wanted, len(candidates)), replace=False)] = True
    return chosen.reshape(shows.shape)


def _percents(numbers: npt.NDArray[np.int32]) -> dict[int, float]:
    """Each number that there is to the percent that are it."""
    found, counts = np.unique(numbers, return_counts=True)
    shares = 100.0 * counts / max(len(numbers), 1)
    return dict(zip(found.tolist(), shares.tolist(), strict=True))


def _percent_within(errors: Float32Array, bound: float | None) -> float:
    """How many errors are within a bound; all where there is none of either."""
    if bound is None or not len(errors):
        return 100.0
    return 100.0 * int(np.count_nonzero(errors <= bound)) / len(errors)


def _percentiles(errors: Float32Array) -> dict[int, float]:
    """Percent to the error in steps of 255 that so many do not exceed; empty without any."""
    if not len(errors):
        return {}
    values = CODES * np.percentile(errors, _PERCENTILES)
    return {percent: float(v) for percent, v in zip(_PERCENTILES, values, strict=True)}
