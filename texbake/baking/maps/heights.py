"""Where a hit becomes a height, a displacement vector or a position.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.normals import to_tangent_space
from texbake.baking.maps.per_hit import Float32Array, per_hit
from texbake.core import core


def displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Signed distance from the low-poly surface at each hit, positive outwards: (n, 1) float32.

    In model units, along the direction in which displacement moves the low-poly mesh: its smooth
    normal, interpolated linearly and then normalized, whatever direction the rays had. With smooth
    rays it is the exact distance along the ray, and displacing the low-poly mesh by it gives the
    high-poly surface back.
    """
    normals, corners = inputs.low_surface.displacement_normals

    def measure(some: Hits, values: Float32Array) -> None:
        core.measure_displacements(
            some.low_faces, some.low_barycentrics, some.offsets, normals, corners, values
        )

    return per_hit(hits, 1, measure, inputs.options.threads)


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
    low = inputs.low

    def move(some: Hits, values: Float32Array) -> None:
        core.move_points(
            some.low_faces, some.low_barycentrics, some.offsets, low.positions, low.faces, values
        )

    return per_hit(hits, 3, move, inputs.options.threads)
