"""Values of hits, computed for one band of hits after another.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

Float32Array = npt.NDArray[np.float32]

_BAND = 1 << 15


def per_hit(
    hits: Hits,
    values: Float32Array | int,
    kernel: Callable[[Hits, Float32Array], object],
    threads: int | None,
) -> Float32Array:
    """(n, C) float32: values that a kernel writes, given them or the number of their channels."""
    if isinstance(values, int):
        values = np.empty((len(hits), values), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        kernel(hits.where(band), values[band])

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return values


def interpolated(
    hits: Hits, values: Float32Array, corners: IntArray, threads: int | None
) -> Float32Array:
    """(n, C) float32: values (N, C) of corners (F, 3) int32, interpolated linearly at the hits."""

    def interpolate(some: Hits, out: Float32Array) -> None:
        core.interpolate_corners(some.high_faces, some.high_barycentrics, values, corners, out)

    return per_hit(hits, values.shape[1], interpolate, threads)
