"""How far the mean over the samples of a pixel may be from the mean over the pixel.

Two things can be wrong. One is the shading. A pixel that was shaded once is judged by a quarter of
the second difference to those beside it: where the picture bends by s along a line through the
pixel its middle is off by s / 8, where it leaps by s, by up to s / 2. A pixel that was shaded in
more cells is judged by how much the last step changed it. Four times as many cells leave half the
error where light has no order, so the mean is off by about half the change; chance is evened out
over the pixels around it.

The other is where edges are. The mean over n x n samples is off by up to half a row of them, but
for most edges by about 0.6 sigma n^-3/2, where sigma is the deviation of the samples, without what
the slope between the pixels around explains. An edge between the samples of one pixel and those of
the next shows in neither, but in the leap between the two pixels.

All of this is an estimate: what no sample of a pixel or of its neighbors meets goes unnoticed.
"""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.adaptive_pixels.pixel_sums import Float32Array, PixelSums
from texbake.rendering.adaptive_pixels.sample_statistics import (
    judge_edges,
    judge_shading,
    write_codes,
)

_ROWS = 32  # of pixels in a band


def code_means(sums: PixelSums, codes: Float32Array, *, threads: int | None) -> None:
    """Write means (H, W, 4) as a file holds them: sRGB-coded light, and opacity as it is."""

    def work(start: int, stop: int) -> None:
        write_codes(sums.light, sums.counts, codes, start, stop)

    run_bands(work, len(codes), band=_ROWS, threads=threads)


def shading_errors(
    codes: Float32Array, shaded: IntArray, changes: Float32Array, *, threads: int | None
) -> Float32Array:
    """Estimate how far coded means may be off by too few shadings, (H, W) float32.

    Parameters
    ----------
    codes : (H, W, 4) float32
    shaded : (H, W) int32
        Cells of each pixel along one side.
    changes : (H, W) float32
        How much the last step of finer shading changed a pixel; 0 where there was none.
    """
    errors = np.empty(shaded.shape, np.float32)

    def work(start: int, stop: int) -> None:
        judge_shading(codes, shaded, changes, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors


def edge_errors(sums: PixelSums, *, threads: int | None) -> Float32Array:
    """Estimate how far coded means may be off by too few samples of edges, (H, W) float32."""
    errors = np.empty(sums.counts.shape, np.float32)

    def work(start: int, stop: int) -> None:
        judge_edges(sums.light, sums.squares, sums.counts, errors, start, stop)

    run_bands(work, len(errors), band=_ROWS, threads=threads)
    return errors
