"""How far the dense surface lies from the light one, along the direction that displacement moves.

That direction is the smooth normal, interpolated linearly and then normalized, whatever direction
the rays went: with smooth rays the value is the exact distance along the ray, and displacing the
light mesh by it gives the dense surface back.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.kernels import kernel
from texbake.parallel import run_bands

_BAND = 1 << 15


def displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Signed distance in model units at each hit, positive outwards: (n, 1) float32."""
    values = np.empty((len(hits), 1), dtype=np.float32)
    normals, corners = inputs.displacement_normals

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _displacement_kernel(
            hits.low_faces[band],
            hits.low_barycentrics[band],
            hits.offsets[band],
            normals,
            corners,
            values[band],
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)
    return values


DISPLACEMENT = MapKind("displacement", 1, "height", displacement_values, lambda options: (0.0,))


@kernel
def _displacement_kernel(faces, barycentrics, offsets, normals, corners, values):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        height = 0.0
        square = 0.0
        for axis in range(3):
            normal = (1.0 - b - c) * normals[p, axis] + b * normals[q, axis] + c * normals[r, axis]
            height += normal * offsets[i, axis]
            square += normal * normal
        values[i, 0] = height / np.sqrt(square) if square > 0.0 else 0.0
