"""Values that the dense mesh has at its corners or faces, at the points that rays hit."""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.maps.kind import Float32Array
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands

_BAND = 1 << 15


def between_corners(
    hits: Hits, values: Float32Array, corners: IntArray, threads: int | None
) -> Float32Array:
    """Values of corners, interpolated linearly: (n, C) float32.

    Parameters
    ----------
    values : (N, C) float32
        Read-only.
    corners : (F, 3) int32
        Row of each corner of the dense mesh's faces; read-only.
    """
    found = np.empty((len(hits), values.shape[1]), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _between_kernel(
            hits.high_faces[band], hits.high_barycentrics[band], values, corners, found[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found


def numbers_of_faces(hits: Hits, ids: IntArray, threads: int | None) -> Float32Array:
    """Numbers from 1 on of the ids (F,) of faces, which count from 0: (n, 1) float32."""
    found = np.empty((len(hits), 1), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        np.add(ids[hits.high_faces[start:stop]], 1, out=found[start:stop, 0], casting="unsafe")

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found


@kernel
def _between_kernel(faces, barycentrics, values, corners, found):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        for channel in range(values.shape[1]):
            found[i, channel] = (
                (1.0 - b - c) * values[p, channel] + b * values[q, channel] + c * values[r, channel]
            )
