"""Where a hit becomes a height, a displacement vector or a position.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.normals import to_tangent_space
from texbake.baking.options import BakeOptions
from texbake.core import core
from texbake.parallel import run_bands

_BAND = 1 << 15


def displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Signed distance from the low-poly surface at each hit, positive outwards: (n, 1) float32.

    In model units, along the direction in which displacement moves the low-poly mesh: its smooth
    normal, interpolated linearly and then normalized, whatever direction the rays had. With smooth
    rays it is the exact distance along the ray, and displacing the low-poly mesh by it gives the
    high-poly surface back.
    """
    values = np.empty((len(hits), 1), dtype=np.float32)
    normals, corners = inputs.low_surface.displacement_normals

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.measure_displacements(
            hits.low_faces[band],
            hits.low_barycentrics[band],
            hits.offsets[band],
            normals,
            corners,
            values[band],
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)
    return values


def vector_displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vector from the low-poly surface to each hit, in model units: (n, 3) float32.

    Unlike a height it also holds overhangs. In tangent space x T + y B + z N is that vector, with
    the interpolated T, B and N.
    """
    values = hits.offsets.copy()
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=False)
    return values


def position_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Point in model space of each hit: (n, 3) float32.

    It is the sample on the low-poly mesh, in float64, plus the offset to the hit, so that its error
    is the rounding of the result alone.
    """
    values = np.empty((len(hits), 3), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.move_points(
            hits.low_faces[band],
            hits.low_barycentrics[band],
            hits.offsets[band],
            inputs.low.positions,
            inputs.low.faces,
            values[band],
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)
    return values


def _origin(_: BakeOptions) -> tuple[float, ...]:
    return (0.0, 0.0, 0.0)


DISPLACEMENT = MapKind("displacement", 1, "height", displacement_values, lambda options: (0.0,))
VECTOR_DISPLACEMENT = MapKind(
    "vector-displacement", 3, "vector", vector_displacement_values, _origin
)
POSITION = MapKind(
    "position", 3, "position", position_values, _origin, bounds=lambda inputs: inputs.bounds
)
# The same map: the transform of a mesh file is applied when the file is read.
WORLD_POSITION = MapKind(
    "world-position", 3, "position", position_values, _origin, bounds=lambda inputs: inputs.bounds
)
