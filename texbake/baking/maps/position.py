"""Where in space the dense surface lies.

A point is that of the sample on the light mesh, in float64, and the way from it to the hit; so its
error is the rounding of the result and not that of a place on a large face.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.options import BakeOptions
from texbake.kernels import kernel
from texbake.parallel import run_bands

_BAND = 1 << 15


def position_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Point in model space of each hit: (n, 3) float32."""
    values = np.empty((len(hits), 3), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _position_kernel(
            hits.low_faces[band],
            hits.low_barycentrics[band],
            hits.offsets[band],
            inputs.low.positions,
            inputs.low.faces,
            values[band],
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)
    return values


def _neutral(_: BakeOptions) -> tuple[float, ...]:
    return (0.0, 0.0, 0.0)


POSITION = MapKind(
    "position", 3, "position", position_values, _neutral, bounds=lambda inputs: inputs.bounds
)
# The same: a mesh file has no transform of its own left when it is read.
WORLD_POSITION = MapKind(
    "world-position", 3, "position", position_values, _neutral, bounds=lambda inputs: inputs.bounds
)


@kernel
def _position_kernel(faces, barycentrics, offsets, positions, corners, values):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        for axis in range(3):
            # From one corner, so that a coordinate that all three share comes out as it is.
            start = positions[p, axis]
            along = b * (positions[q, axis] - start) + c * (positions[r, axis] - start)
            values[i, axis] = start + along + offsets[i, axis]
