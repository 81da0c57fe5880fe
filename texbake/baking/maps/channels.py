"""Maps of the high-poly mesh's materials: one for each channel, except for the normal.

Images are looked up at each hit, bilinearly and in linear light.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.channel_images import MaterialPoints
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.per_hit import Float32Array, interpolated
from texbake.errors import MeshError
from texbake.mesh.materials import CHANNELS, Channel, ChannelSource
from texbake.mesh.mesh import frozen

_OF_VERTEX_COLORS = ("base-color", "alpha")


def channel_values(name: str, hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Linear values of a channel at each hit: (n, 1) or (n, 3) float32.

    Its default for a material that does not set it.
    """
    assert inputs.materials is not None
    channel = CHANNELS[name]
    values = np.empty((len(hits), len(channel.default)), dtype=np.float32)
    sources = inputs.materials.sources(channel.name)
    for source, points in zip(sources, inputs.high_surface.material_points(hits), strict=True):
        values[points.rows] = _source_values(channel, source, points, inputs)
    if inputs.materials.has_vertex_colors:
        factors = _vertex_factors(channel, inputs)
        if factors is not None:
            values *= interpolated(hits, factors, inputs.high.faces, inputs.options.threads)
    return values


def _vertex_factors(channel: Channel, inputs: BakeInputs) -> Float32Array | None:
    """(V, width) float32: the factor that colors of vertices are of a channel; None for none."""
    colors = inputs.high.colors
    if channel.name == "base-color":
        return inputs.high_surface.colors
    if channel.name == "alpha" and colors is not None and colors.shape[1] == 4:
        return frozen(np.ascontiguousarray(colors[:, 3:]))
    return None


def _source_values(
    channel: Channel, source: ChannelSource | None, points: MaterialPoints, inputs: BakeInputs
) -> Float32Array:
    """(n, width) float32, or (width,) for all points: a channel of one material."""
    factor = np.array(channel.default if source is None else source.factor, dtype=np.float32)
    if source is None or source.image is None:
        return factor
    values = inputs.high_surface.images.values(source.image, points, is_color=channel.is_color)
    if (factor != 1.0).any():
        values *= factor
    if source.offset != 0.0:
        values += np.float32(source.offset)
    return values


def require_channel(name: str, inputs: BakeInputs) -> None:
    """Raise `MeshError` if no material sets a channel, or an image has no place."""
    high, materials = inputs.high, inputs.materials
    known = [] if materials is None else [s for s in materials.sources(name) if s]
    of_vertices = (
        materials is not None and materials.has_vertex_colors and name in _OF_VERTEX_COLORS
    )
    if not known and not of_vertices:
        noun = name.replace("-", " ")
        raise MeshError(
            f"{high.name}: its file names no {noun} to bake; give its image as `high_texture`, or "
            f"leave {name} out of `maps`"
        )
    images = [source.image for source in known if source.image is not None]
    if high.uvs is None and images:
        raise MeshError(
            f"{high.name}: it has no texture coordinates, which its image needs; "
            f"leave {name} out of `maps`"
        )
