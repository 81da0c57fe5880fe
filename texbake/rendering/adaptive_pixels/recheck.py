"""Checking the error estimates by sampling some pixels again, with more and different samples.

The check takes `SIDE` x `SIDE` samples per pixel and shades each of them. `SIDE` is odd, so apart
from the center none of them coincides with an adaptive sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import numpy.typing as npt

from texbake.rendering.adaptive_pixels.pixel_statistics import PixelSums, code_means
from texbake.rendering.adaptive_pixels.sampler import BoolArray, Sides
from texbake.sampling.bounds import CODES, format_codes
from texbake.sampling.report import (
    ErrorSummary,
    SamplingReport,
    check_random,
    format_percents,
    n_to_check,
    percent_within,
    percentiles_of,
)

if TYPE_CHECKING:
    from texbake.rendering.adaptive_pixels.samples import AdaptivePicture

SIDE = 15
# Pixels are chosen from this many times as many, grouped in runs of rows so that few rows need to
# be rasterized.
AMONG = 10
RUN = 4


@dataclass(frozen=True, kw_only=True)
class PictureSampling(SamplingReport):
    """Report on the adaptive samples of a picture.

    All samples of a triangle within one cell of a pixel share one shading.
    """

    shaded_percents: dict[int, float]  # percentage of pixels by their number of shaded cells
    # Cells shaded per pixel that shows a surface, including cells replaced by finer ones
    shadings_per_pixel: float

    element: ClassVar[str] = "pixel"
    most_samples: ClassVar[int] = 256

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a value, for display."""
        shadings = format_percents(self.shaded_percents)
        return [
            ("shadings per pixel", f"{shadings}; {self.shadings_per_pixel:.2f} taken on average"),
            ("samples per pixel", format_percents(self.sample_percents)),
            *super().table(),
        ]


def recheck(adaptive: AdaptivePicture, bound: float | None) -> PictureSampling:
    """Sample one pixel in a hundred again, always the same ones, and report on all samples."""
    sampler, sums, errors = adaptive.sampler, adaptive.sums, adaptive.errors()
    shows = sums.covered > 0.0
    n_pixels = int(np.count_nonzero(shows))
    n_shaded = sampler.n_shaded
    chosen = chosen_pixels(shows)
    again = PixelSums.empty(*shows.shape)
    sampler.take(chosen, Sides(SIDE, SIDE), again)
    codes = np.zeros_like(adaptive.codes)
    code_means(again, codes, threads=adaptive.threads)
    apart = np.abs(adaptive.codes[chosen] - codes[chosen]).max(axis=-1)
    summary = ErrorSummary(
        name="color",
        unit=f"/ {CODES}",
        bound=None if bound is None else CODES * bound,
        estimated=percentiles_of(errors[shows], CODES),
        measured=percentiles_of(apart, CODES),
        measured_within_percent=percent_within(apart, bound),
    )
    return PictureSampling(
        max_error=None if bound is None else format_codes(bound),
        sample_percents=_percents(sums.counts[shows]),
        within_percent=percent_within(errors[shows], bound),
        n_checked=len(apart),
        samples_of_check=SIDE**2,
        errors=(summary,),
        shaded_percents=_percents(adaptive.shaded[shows] ** 2),
        shadings_per_pixel=n_shaded / max(n_pixels, 1),
    )


def chosen_pixels(shows: BoolArray) -> BoolArray:
    """(H, W) bool: pixels chosen at random within randomly chosen runs of rows."""
    rng = check_random()
    by_row = np.count_nonzero(shows, axis=1)
    runs = np.add.reduceat(by_row, np.arange(0, len(by_row), RUN))
    n_wanted = n_to_check(int(by_row.sum()))
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
    """Return the percentage of each number that occurs."""
    values, counts = np.unique(numbers, return_counts=True)
    shares = 100.0 * counts / max(len(numbers), 1)
    return dict(zip(values.tolist(), shares.tolist(), strict=True))
