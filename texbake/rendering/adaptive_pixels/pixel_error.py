"""Estimating the error of adaptively sampled pixels: the mean of the samples against the true mean.

There are two sources of error. The first is the shading. For a pixel that was shaded once, the
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

Kernel: `core/sample_statistics.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.adaptive_pixels.pixel_sums import Float32Array, PixelSums

_ROWS = 32  # pixel rows per band


def code_means(sums: PixelSums, codes: Float32Array, *, threads: int | None) -> None:
    """Write the means (H, W, 4) as encoded in a file: light in sRGB, opacity linear."""

    def work(start: int, stop: int) -> None:
        core.write_codes(sums.light, sums.counts, codes, start, stop)

    run_bands(work, len(codes), band=_ROWS, threads=threads)


def shading_errors(
    codes: Float32Array, shaded: IntArray, changes: Float32Array, *, threads: int | None
) -> Float32Array:
    """Estimate the error of the encoded means due to too few shadings, (H, W) float32.

    `codes` (H, W, 4) float32; `shaded` (H, W) int32; `changes` (H, W) float32.
    """
    errors = np.empty(shaded.shape, np.float32)

    def work(start: int, stop: int) -> None:
        core.judge_shading(codes, shaded, changes, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors


def edge_errors(sums: PixelSums, *, threads: int | None) -> Float32Array:
    """Estimate the error of the encoded means due to too few edge samples, (H, W) float32."""
    errors = np.empty(sums.counts.shape, np.float32)

    def work(start: int, stop: int) -> None:
        core.judge_edges(sums.light, sums.squares, sums.counts, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors
