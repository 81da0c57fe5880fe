"""Fans of rays as arrays, through embreex's public interface: one direction of many fans a call."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.baking.secondary import (
    DEPTH,
    N_COLUMNS,
    OPEN,
    OPEN_DIRECTION,
)
from texbake.baking.secondary.fans import Fans, directions_kernel, frames_kernel
from texbake.baking.secondary.reach import Reach

Float32Array = npt.NDArray[np.float32]
# (origins, directions, lengths, query) to a value for each ray
Query = Callable[[Float32Array, Float32Array, Float32Array, str], npt.NDArray[np.generic]]

_FARTHEST = np.finfo(np.float32).max


def cast_arrays(run: Query, fans: Fans, sets: Float32Array, reach: Reach) -> Float32Array:
    """As `packets.cast_packets`, by calls of embreex's `EmbreeScene.run`."""
    n, n_rays = len(fans), sets.shape[1]
    results = np.full((n, N_COLUMNS), np.nan, dtype=np.float32)
    frames, directions = np.empty((12, n), np.float32), np.empty((3, n), np.float32)
    frames_kernel(fans.axes, fans.planes, 0, frames)
    set_ids = fans.set_ids & np.uint32(len(sets) - 1)

    def cast(side: float, length: float, query: str, j: int) -> npt.NDArray[np.generic]:
        directions_kernel(frames, set_ids, sets, j, np.float32(side), directions)
        origins = (fans.points + side * reach.offset * fans.planes).astype(np.float32)
        lengths = np.full(n, min(length, _FARTHEST), dtype=np.float32)
        return run(origins, np.ascontiguousarray(directions.T), lengths, query)

    if reach.outer > 0.0:
        sums = np.zeros((n, 4), dtype=np.float32)
        for j in range(n_rays):
            free = (cast(1.0, reach.outer, "OCCLUDED", j) != 0).astype(np.float32)
            sums[:, 0] += free
            sums[:, 1:] += free[:, np.newaxis] * directions.T
        results[:, OPEN] = sums[:, 0] / n_rays
        results[:, OPEN_DIRECTION] = sums[:, 1:] / n_rays
        closed = sums[:, 0] == 0.0
        results[closed, OPEN_DIRECTION] = fans.axes[closed]
    if reach.inner > 0.0:
        way = np.zeros(n, dtype=np.float32)
        for j in range(n_rays):
            way += cast(-1.0, reach.inner, "DISTANCE", j).astype(np.float32)
        results[:, DEPTH] = way / n_rays
    return results
