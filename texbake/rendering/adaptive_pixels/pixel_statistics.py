"""Sums of samples per pixel and of their squares, and the error of the means that follows.

Errors of the mean have two sources. The first is the shading. For a pixel that was shaded once, the
estimate is a quarter of the second difference to its neighbors: where the picture bends by s across
the pixel, its center is off by s / 8; at a discontinuity of s, by up to s / 2. For a pixel that was
shaded in several cells, the estimate is based on how much the last refinement changed it. With
uncorrelated light, four times as many cells halve the error, so the remaining error is about half
the change. It is averaged over the surrounding pixels to reduce noise.

The second source is the position of edges. The mean over n x n samples is off by up to half a row
of samples, but for most edges by about 0.6 sigma n^-3/2. Here sigma is the standard deviation of
the samples, minus the part explained by the slope between neighboring pixels. An edge that falls
between the samples of two pixels shows only in the difference between these pixels.

The result is an estimate: detail that no sample of a pixel or of its neighbors hits goes unnoticed.
`recheck` samples some pixels again, with `SIDE` x `SIDE` samples that are shaded each. `SIDE` is
odd, so apart from the center none of them coincides with an adaptive sample.

Kernel: `core/sample_statistics.c`.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.effects.transparency import LayeredSamples
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


@dataclasses.dataclass(frozen=True, order=True)
class Sides:
    """Samples and shaded cells along one side of a pixel; `shaded` divides `seen`."""

    seen: int
    shaded: int


@dataclass(frozen=True, eq=False)
class PixelSums:
    """Sums over the samples of each pixel."""

    # light, squares (H, W, 4): sums of light and opacity, and of their squares. Light is composited
    # over the background, or over black.
    light: FloatArray
    squares: FloatArray
    covered: Float32Array  # (H, W): number of samples that show a surface
    counts: IntArray  # (H, W): number of samples

    @classmethod
    def empty(cls, height: int, width: int) -> PixelSums:
        """Return sums without any samples."""
        return cls(
            np.zeros((height, width, 4)),
            np.zeros((height, width, 4)),
            np.zeros((height, width), np.float32),
            np.zeros((height, width), np.int32),
        )

    @property
    def means(self) -> FloatArray:
        """(H, W, 4) float64 means; 0 where there is no sample."""
        return self.light / np.maximum(self.counts, 1)[..., None]

    @property
    def coverage(self) -> Float32Array:
        """(H, W) float32: share of the samples that show a surface."""
        return np.asarray(self.covered / np.maximum(self.counts, 1), np.float32)

    def add(self, pixels: IntArray, counts: Float32Array, light: Float32Array) -> None:
        """Add opaque fragments to their pixels, weighted by their numbers of samples."""
        core.add_fragments_squared(
            pixels, counts, light,
            self.light.reshape(-1, 4), self.squares.reshape(-1, 4), self.covered.reshape(-1),
        )  # fmt: skip

    def add_samples(
        self, samples: LayeredSamples, behind: Float32Array, first_row: int, side: int
    ) -> None:
        """Add samples of some rows of pixels, composited over `behind` (H, W, 3) or (1, 1, 3)."""
        core.add_samples_squared(
            samples.light, samples.passed, samples.seen, behind, first_row, side,
            self.light, self.squares, self.covered,
        )  # fmt: skip

    def write_to(
        self,
        sums: PixelSums,
        corner: tuple[int, int],
        mask: BoolArray,
        behind: Float32Array | None,
        *,
        side: int,
        is_opaque: bool,
    ) -> None:
        """Write masked pixels of a window to a picture, over what is `behind`, if not None."""
        core.write_window(
            mask, *corner, side, _DARK if behind is None else behind, is_opaque, behind is not None,
            self.light, self.squares, self.covered, sums.light, sums.squares, sums.covered,
        )  # fmt: skip


_DARK = np.zeros((1, 1, 3), np.float32)


_ROWS = 32  # pixel rows per band


def code_means(sums: PixelSums, codes: Float32Array, *, threads: int | None) -> None:
    """Write the means (H, W, 4) as encoded in a file: light in sRGB, opacity linear."""
    kernel = partial(core.write_codes, sums.light, sums.counts, codes)
    run_bands(kernel, len(codes), band=_ROWS, threads=threads)


def shading_errors(
    codes: Float32Array, shaded: IntArray, changes: Float32Array, *, threads: int | None
) -> Float32Array:
    """(H, W): estimated errors of the means `codes` (H, W, 4) due to too few shadings."""
    errors = np.empty(shaded.shape, np.float32)
    kernel = partial(core.judge_shading, codes, shaded, changes, errors)
    run_bands(kernel, len(errors), band=_ROWS, threads=threads)
    return errors


def edge_errors(sums: PixelSums, *, threads: int | None) -> Float32Array:
    """Estimate the error of the encoded means due to too few edge samples, (H, W) float32."""
    errors = np.empty(sums.counts.shape, np.float32)
    kernel = partial(core.judge_edges, sums.light, sums.squares, sums.counts, errors)
    run_bands(kernel, len(errors), band=_ROWS, threads=threads)
    return errors


SIDE = 15
# Pixels are chosen from this many times as many, grouped in runs of rows so that few rows need to
# be rasterized.
AMONG = 10
RUN = 4


@dataclass(frozen=True, kw_only=True)
class PictureSampling(SamplingReport):
    """Report on the adaptive samples of a picture."""

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


def _percents(numbers: IntArray) -> dict[int, float]:
    """Return the percentage of each number that occurs."""
    values, counts = np.unique(numbers, return_counts=True)
    shares = 100.0 * counts / max(len(numbers), 1)
    return dict(zip(values.tolist(), shares.tolist(), strict=True))
