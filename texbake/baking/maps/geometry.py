"""Maps of the high-poly surface itself: normals, heights over the low-poly mesh, positions.

Where a material of the high-poly mesh has a normal map of its own, the shading normal is that of
the map, in the tangent space of the high-poly mesh.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008: a renderer computes
x T + y B + z N from the interpolated tangent and normal without renormalizing them, with
B = w cross(N, T). So the frame is inverted exactly as it is, and only the result is normalized.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.maps.kind import FLAT, MapKind

if TYPE_CHECKING:
    from texbake.baking.hits import Float32Array, Hits
    from texbake.baking.inputs import BakeInputs


def normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit normal of the high-poly mesh at each hit, in the space that the options specify.

    Where the tangent frame is singular (a zero normal) the value is flat, (0, 0, 1).
    """
    from texbake.core import core

    normals, corners = inputs.high_surface.normals

    def interpolate(some: Hits, values: Float32Array) -> None:
        core.interpolate_high_normals(
            some.high_faces, some.high_barycentrics, normals, corners, values
        )

    values = hits.computed(3, interpolate, inputs.options.threads)
    if inputs.has_normal_maps:
        from texbake.baking.channel_images import replace_by_normal_maps

        replace_by_normal_maps(hits, inputs, values)
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=True)
    return values


def to_tangent_space(
    hits: Hits, inputs: BakeInputs, values: Float32Array, *, normalize: bool
) -> None:
    """Express model-space vectors (n, 3) in the low-poly tangent space of their hits, in place."""
    from texbake.core import core

    normals, corners = inputs.low_surface.normals
    tangents = inputs.low_surface.tangents

    def turn(some: Hits, vectors: Float32Array) -> None:
        core.to_tangent_space(
            some.low_faces, some.low_barycentrics, normals, corners, tangents, normalize, vectors
        )

    hits.computed(values, turn, inputs.options.threads)


def displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Signed distance from the low-poly surface at each hit, positive outwards: (n, 1) float32.

    In model units, along the direction in which displacement moves the low-poly mesh: its smooth
    normal, interpolated linearly and then normalized, whatever direction the rays had. With smooth
    rays it is the exact distance along the ray, and displacing the low-poly mesh by it gives the
    high-poly surface back.
    """
    from texbake.core import core

    normals, corners = inputs.low_surface.displacement_normals

    def measure(some: Hits, values: Float32Array) -> None:
        core.measure_displacements(
            some.low_faces, some.low_barycentrics, some.offsets, normals, corners, values
        )

    return hits.computed(1, measure, inputs.options.threads)


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
    from texbake.core import core

    low = inputs.low

    def move(some: Hits, values: Float32Array) -> None:
        core.move_points(
            some.low_faces, some.low_barycentrics, some.offsets, low.positions, low.faces, values
        )

    return hits.computed(3, move, inputs.options.threads)


KINDS = (
    MapKind("normal", 3, "normal", normal_values, combine="unit mean", plain=FLAT),
    MapKind("displacement", 1, "height", displacement_values, plain=(0.0,)),
    MapKind("vector-displacement", 3, "vector", vector_displacement_values, plain=(0.0, 0.0, 0.0)),
    MapKind("position", 3, "position", position_values),
    # The same map: the transform of a mesh file is applied when the file is read.
    MapKind("world-position", 3, "position", position_values),
)
