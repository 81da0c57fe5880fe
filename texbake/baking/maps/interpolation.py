"""Values of corners, interpolated at the points that rays hit.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.maps.kind import Float32Array
from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

_BAND = 1 << 15


def interpolated(
    hits: Hits, values: Float32Array, corners: IntArray, threads: int | None
) -> Float32Array:
    """Values of corners, interpolated linearly at the hits: (n, C) float32.

    `values` (N, C) float32; `corners` (F, 3) int32.
    """
    found = np.empty((len(hits), values.shape[1]), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.interpolate_corners(
            hits.high_faces[band], hits.high_barycentrics[band], values, corners, found[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found
