"""Where a hit becomes a normal: the high-poly mesh's shading normal in the low-poly tangent space.

Where a material of the high-poly mesh has a normal map of its own, the shading normal is that of
the map, in the tangent space of the high-poly mesh.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008: a renderer computes
x T + y B + z N from the interpolated tangent and normal without renormalizing them, with
B = w cross(N, T). So the frame is inverted exactly as it is, and only the result is normalized.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.channel_images import MaterialPoints
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.per_hit import Float32Array, per_hit
from texbake.core import core, portable_math as pm
from texbake.mesh.materials import ChannelImage, ChannelSource
from texbake.mesh.tangents import image_axes
from texbake.parallel import run_bands

_BAND = 1 << 15


def normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit normal of the high-poly mesh at each hit, in the space that the options specify.

    Where the tangent frame is singular (a zero normal) the value is flat, (0, 0, 1).
    """
    normals, corners = inputs.high_surface.normals

    def interpolate(some: Hits, values: Float32Array) -> None:
        core.interpolate_high_normals(
            some.high_faces, some.high_barycentrics, normals, corners, values
        )

    values = per_hit(hits, 3, interpolate, inputs.options.threads)
    if inputs.has_normal_maps:
        _bend(hits, inputs, values)
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=True)
    return values


def _bend(hits: Hits, inputs: BakeInputs, values: Float32Array) -> None:
    """Replace normals where the high-poly mesh has a normal map, in place."""
    assert inputs.materials is not None
    sources = inputs.materials.sources("normal")
    for source, points in zip(sources, inputs.high_surface.material_points(hits), strict=True):
        if source is not None and source.image is not None:
            values[points.rows] = _mapped_normals(source, source.image, points, inputs)


def _mapped_normals(
    source: ChannelSource, image: ChannelImage, points: MaterialPoints, inputs: BakeInputs
) -> Float32Array:
    """(n, 3) float32: unit normals of a normal map at points of the high-poly faces."""
    surface = inputs.high_surface
    normals, corners = surface.normals
    tangents = surface.tangents
    vectors = surface.images.values(image, points, is_color=False)
    factor = np.array(source.factor, np.float32)
    axes = np.eye(2, dtype=np.float32)
    if inputs.high.tangents is None:
        axes = image_axes(np.array(image.placing)[:, :2])
    is_turned = (axes != np.eye(2)).any()

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        vectors[band] = (vectors[band] * 2.0 - 1.0) * factor
        if is_turned:
            vectors[band, :2] = pm.matmul(vectors[band, :2], axes)
        core.from_tangent_space(
            points.faces[band], points.barycentrics[band], normals, corners, tangents, vectors[band]
        )

    run_bands(work, len(points.faces), band=_BAND, threads=inputs.options.threads)
    return vectors


def to_tangent_space(
    hits: Hits, inputs: BakeInputs, values: Float32Array, *, normalize: bool
) -> None:
    """Express model-space vectors (n, 3) in the low-poly tangent space of their hits, in place."""
    normals, corners = inputs.low_surface.normals
    tangents = inputs.low_surface.tangents

    def turn(some: Hits, vectors: Float32Array) -> None:
        core.to_tangent_space(
            some.low_faces, some.low_barycentrics, normals, corners, tangents, normalize, vectors
        )

    per_hit(hits, values, turn, inputs.options.threads)
