"""Measure the values of a map before they are coded: range, clipped values, percentiles.

Kernel: `core/value_range.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import OptionError
from texbake.mesh.mesh import BoolArray, Float32Array, Int64Array
from texbake.parallel import run_bands
from texbake.texture.encoding import max_code

# Texels per band: a few milliseconds of work.
_BAND = 1 << 19


def channel_ranges(
    values: npt.NDArray[Any], covered: BoolArray, *, threads: int | None = None
) -> Float32Array:
    """(C, 2) least and greatest finite values of covered texels; (inf, -inf) without any."""
    rows, texels = _of_texels(values, covered)
    nothing = np.tile(np.array([np.inf, -np.inf], np.float32), (rows.shape[1], 1))
    found = [nothing]

    def work(start: int, stop: int) -> None:
        ranges = nothing.copy()
        core.measure_ranges(rows, texels, ranges, start, stop)
        found.append(ranges)

    run_bands(work, len(texels), band=_BAND, threads=threads)
    lows, highs = np.min(found, axis=0)[:, 0], np.max(found, axis=0)[:, 1]
    return np.stack([lows, highs], axis=1)


def height_range(
    heights: npt.NDArray[Any],
    covered: BoolArray,
    *,
    bits: int = 16,
    mid: float | None = None,
    threads: int | None = None,
) -> tuple[float, float]:
    """Mid level and scale, in model units, for covered heights d = (h - mid) * scale in [0, 1]."""
    mid = (max_code(bits) + 1) / 2 / max_code(bits) if mid is None else mid
    if not 0.0 <= mid <= 1.0:
        raise OptionError(f"mid: {mid} is not a level between 0 and 1")
    ranges = channel_ranges(heights, covered, threads=threads)
    below, above = -float(ranges[:, 0].min(initial=0.0)), float(ranges[:, 1].max(initial=0.0))
    if (above > 0.0 and mid == 1.0) or (below > 0.0 and mid == 0.0):
        raise OptionError(
            f"mid: {mid} leaves no room for heights from {-below:.6g} to {above:.6g}; use 0.5"
        )
    scale = max(above / (1.0 - mid) if above else 0.0, below / mid if below else 0.0)
    return mid, scale if scale > 0.0 else 1.0


def count_clipped(
    heights: npt.NDArray[Any],
    covered: BoolArray,
    *,
    mid: float,
    scale: float,
    threads: int | None = None,
) -> int:
    """Count the covered heights that integer codes clip with this mid level and scale."""
    values, texels = _of_texels(heights, covered)
    counts: list[int] = []

    def work(start: int, stop: int) -> None:
        # The rounding error of scale and of the division, relative to the whole range.
        limits = -1e-9, 1.0 + 1e-9
        counts.append(core.count_outside(values, texels, scale, mid, *limits, start, stop))

    run_bands(work, len(texels), band=_BAND, threads=threads)
    return sum(counts)


def size_at_percentile(
    values: Float32Array, covered: BoolArray, percentile: float, *, threads: int | None = None
) -> float:
    """Size that a percentage of covered values do not exceed, interpolated; 0 without any."""
    rows, texels = _of_texels(values, covered)

    def counts_of(count: Callable[[Int64Array, int, int], None]) -> Int64Array:
        parts: list[Int64Array] = []

        def work(start: int, stop: int) -> None:
            part = np.zeros(1 << 16, np.int64)
            count(part, start, stop)
            parts.append(part)

        run_bands(work, len(texels), band=4 * _BAND, threads=threads)
        return np.sum(parts, axis=0, dtype=np.int64) if parts else np.zeros(1 << 16, np.int64)

    uppers = np.cumsum(counts_of(partial(core.count_upper_halves, rows, texels)))

    def size_at(rank: int) -> np.float32:
        upper = int(np.searchsorted(uppers, rank, side="right"))
        before = int(uppers[upper - 1]) if upper else 0
        lowers = np.cumsum(
            counts_of(lambda part, *band: core.count_lower_halves(rows, texels, part, upper, *band))
        )
        lower = int(np.searchsorted(lowers, rank - before, side="right"))
        return np.uint32(upper << 16 | lower).view(np.float32)

    n = int(uppers[-1])
    if n == 0:
        return 0.0
    place = (n - 1) * (percentile / 100.0)
    below = int(place)
    along = place - below
    low, high = size_at(below), size_at(min(below + 1, n - 1))
    # From the nearer of the two, as numpy does.
    if along >= 0.5:
        return float(high - (high - low) * np.float32(1.0 - along))
    return float(low + (high - low) * np.float32(along))


def _of_texels(values: npt.NDArray[Any], covered: BoolArray) -> tuple[Float32Array, BoolArray]:
    """Return values (H, W) or (H, W, C) as (n, C), and which texels are covered as (n,)."""
    texels = np.require(covered, np.bool_, ["C", "A"]).reshape(-1)
    n_channels = values.size // max(len(texels), 1)
    rows = np.require(values, np.float32, ["C", "A"]).reshape(len(texels), n_channels)
    return rows, texels
