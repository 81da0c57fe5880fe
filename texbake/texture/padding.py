"""Values carried past the border of charts, so that filtering never reads background.

First by dilation: a texel that no chart owns takes the value of the owner nearest to it, up to so
many texels away. One search for the nearest owners serves all maps of a bake. Then, where wanted,
by push-pull, which fills all the rest smoothly, so that no mip level shows background.

Based on: Gortler et al., "The Lumigraph", 1996, section 4.3, for push-pull. Departs from it in that
weights are 0 or 1 in every level.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.nearest import NearestOwners, nearest_owner

__all__ = ["NearestOwners", "nearest_owner", "push_pull", "spread"]

# Rows a band: some milliseconds of work.
_ROW_BAND = 128

FloatImage = npt.NDArray[np.float32]


@kernel
def _spread_kernel(values, indices, background, out, start, stop):  # type: ignore[no-untyped-def]
    n_channels = values.shape[1]
    for i in range(start, stop):
        source = indices[i]
        finite = source >= 0
        if source >= 0 and source != i:
            for channel in range(n_channels):
                finite = finite and np.isfinite(values[source, channel])
        for channel in range(n_channels):
            out[i, channel] = values[source, channel] if finite else background[channel]


def spread(
    values: npt.NDArray[Any],
    indices: npt.NDArray[np.int32],
    *,
    background: float | npt.ArrayLike = 0.0,
    threads: int | None = None,
) -> FloatImage:
    """Give each texel the value of its nearest owner.

    Parameters
    ----------
    values : (H, W, C) float32
        Read at owners alone.
    indices : (H, W) int32
        `NearestOwners.indices`.
    background
        A number, or one a channel, for texels out of reach, and for those whose nearest owner is
        not finite in all channels. An owner keeps its value whatever it is.

    Returns
    -------
    (H, W, C) float32
    """
    height, width, n_channels = values.shape
    flat = np.require(values, np.float32, ["C", "W"]).reshape(-1, n_channels)
    sources = np.require(indices, np.int32, ["C", "W"]).reshape(-1)
    fill = np.broadcast_to(np.asarray(background, np.float32), n_channels).copy()
    out = np.empty_like(flat)

    def work(start: int, stop: int) -> None:
        _spread_kernel(flat, sources, fill, out, start, stop)

    run_bands(work, len(flat), band=_ROW_BAND * max(width, 1), threads=threads)
    return out.reshape(height, width, n_channels)


@kernel
def _push_kernel(values, mask, coarse, coarse_mask, start, stop):  # type: ignore[no-untyped-def]
    """Means of the valid, finite texels of each 2 x 2 block, for coarse rows start on."""
    height, width, n_channels = values.shape
    totals = np.empty(n_channels, np.float64)
    for row in range(start, stop):
        for column in range(coarse.shape[1]):
            totals[:] = 0.0
            count = 0
            for y in range(2 * row, min(2 * row + 2, height)):
                for x in range(2 * column, min(2 * column + 2, width)):
                    if not mask[y, x]:
                        continue
                    finite = True
                    for channel in range(n_channels):
                        finite = finite and np.isfinite(values[y, x, channel])
                    if finite:
                        count += 1
                        for channel in range(n_channels):
                            totals[channel] += values[y, x, channel]
            for channel in range(n_channels):
                coarse[row, column, channel] = totals[channel] / max(count, 1)
            coarse_mask[row, column] = count > 0


@kernel
def _pull_kernel(values, mask, coarse, start, stop):  # type: ignore[no-untyped-def]
    """Fill rows start on, where not valid, with the coarser level, interpolated bilinearly."""
    width, n_channels = values.shape[1:]
    last_row = coarse.shape[0] - 1
    last_column = coarse.shape[1] - 1
    for y in range(start, stop):
        near_row = y // 2
        far_row = min(max(near_row + (1 if y % 2 else -1), 0), last_row)
        for x in range(width):
            if mask[y, x]:
                continue
            near = x // 2
            far = min(max(near + (1 if x % 2 else -1), 0), last_column)
            for channel in range(n_channels):
                # Sixteenths of float32 add up exactly in float64, so a constant stays constant.
                total = 9.0 * coarse[near_row, near, channel]
                total += 3.0 * coarse[near_row, far, channel]
                total += 3.0 * coarse[far_row, near, channel]
                total += 1.0 * coarse[far_row, far, channel]
                values[y, x, channel] = total / 16.0


def push_pull(
    values: npt.NDArray[Any], mask: npt.NDArray[np.bool_], *, threads: int | None = None
) -> FloatImage:
    """Fill everything outside `mask`, smoothly, from what is inside it.

    Parameters
    ----------
    values : (H, W, C) float32
        Any size; it need not be a power of two.
    mask : (H, W) bool
        Texels to keep. One that is not finite in all channels is kept, but fills nothing.

    Returns
    -------
    (H, W, C) float32
        `values`, bit-equal inside `mask`; a new array. Where the mask is empty it is `values`
        everywhere, because there is nothing to fill with.
    """
    level = np.array(values, np.float32)
    valid = np.require(mask, np.bool_, ["C", "W"])
    levels = [(level, valid)]
    while max(level.shape[:2]) > 1:
        level, valid = _pushed(level, valid, threads)
        levels.append((level, valid))
    if not valid.any():
        return levels[0][0]
    for (level, valid), (coarse, _) in zip(levels[-2::-1], levels[:0:-1], strict=True):
        _pull(level, valid, coarse, threads)
    return levels[0][0]


def _pushed(
    values: FloatImage, mask: npt.NDArray[np.bool_], threads: int | None
) -> tuple[FloatImage, npt.NDArray[np.bool_]]:
    """Return the next coarser level, of half the size rounded up, and where it is valid."""
    height, width = (values.shape[0] + 1) // 2, (values.shape[1] + 1) // 2
    coarse = np.empty((height, width, values.shape[2]), np.float32)
    coarse_mask = np.empty((height, width), np.bool_)

    def work(start: int, stop: int) -> None:
        _push_kernel(values, mask, coarse, coarse_mask, start, stop)

    run_bands(work, height, band=_ROW_BAND, threads=threads)
    return coarse, coarse_mask


def _pull(
    values: FloatImage, mask: npt.NDArray[np.bool_], coarse: FloatImage, threads: int | None
) -> None:
    """Fill `values` in place, where not in `mask`, from the next coarser level."""

    def work(start: int, stop: int) -> None:
        _pull_kernel(values, mask, coarse, start, stop)

    run_bands(work, len(values), band=_ROW_BAND, threads=threads)
