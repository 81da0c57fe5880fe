"""Maps of the high-poly mesh's materials: one for each channel, except for the normal.

Images are looked up at each hit, bilinearly and in linear light, in `baking/channel_images.py`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.maps.kind import MapKind
from texbake.errors import MeshError

if TYPE_CHECKING:
    from texbake.baking.hits import Float32Array, Hits
    from texbake.baking.inputs import BakeInputs

_OF_VERTEX_COLORS = ("base-color", "alpha")


def channel_values(name: str, hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Linear values of a channel at each hit: (n, 1) or (n, 3) float32."""
    from texbake.baking.channel_images import values_at_hits

    return values_at_hits(name, hits, inputs)


def require_channel(name: str, inputs: BakeInputs) -> None:
    """Raise `MeshError` if no material sets a channel, or an image has no place."""
    high, materials = inputs.high, inputs.materials
    sources = [] if materials is None else [s for s in materials.sources(name) if s]
    of_vertices = (
        materials is not None and materials.has_vertex_colors and name in _OF_VERTEX_COLORS
    )
    if not sources and not of_vertices:
        noun = name.replace("-", " ")
        raise MeshError(
            f"{high.name}: its file names no {noun} to bake; give its image as `high_texture`, or "
            f"leave {name} out of `maps`"
        )
    images = [source.image for source in sources if source.image is not None]
    if high.uvs is None and images:
        raise MeshError(
            f"{high.name}: it has no texture coordinates, which its image needs; "
            f"leave {name} out of `maps`"
        )


def _channel(name: str, coding: str = "mask", empty: float = 0.0) -> MapKind:
    """Return the map of a channel of materials."""
    return MapKind(
        name,
        3 if coding == "color" else 1,
        coding,
        channel_values,
        is_channel=True,
        hides_misses=True,
        empty=empty,
        require_function=require_channel,
    )


KINDS = (
    _channel("base-color", "color"),
    _channel("alpha", empty=1.0),
    _channel("metallic"),
    _channel("roughness", empty=1.0),
    _channel("occlusion", empty=1.0),
    _channel("emissive", "color"),
    _channel("clearcoat"),
    _channel("clearcoat-roughness"),
    _channel("transmission"),
    _channel("sheen-color", "color"),
    _channel("sheen-roughness"),
    _channel("specular", empty=1.0),
    _channel("specular-color", "color"),
)
