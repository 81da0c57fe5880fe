"""Maps of high-poly attributes: curvature, ids, vertex colors, channels of materials.

There is a map for each channel, except for the normal. Images are looked up at each hit, bilinearly
and in linear light, in `baking/channel_images.py`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.maps.kind import MapKind
from texbake.errors import MeshError

if TYPE_CHECKING:
    from texbake.baking.hits import Hits
    from texbake.baking.inputs import BakeInputs
    from texbake.mesh.mesh import Float32Array, IntArray


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


_CHANNELS = (
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


def curvature_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean curvature at each hit, per model unit, positive where convex: (n, 1)."""
    high = inputs.high_surface
    return hits.interpolated(high.curvatures, high.mesh.faces, inputs.options.threads)


def convexity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is convex, else 0: (n, 1)."""
    import numpy as np

    values = curvature_values(hits, inputs)
    return np.maximum(values, 0.0, out=values)


def concavity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is concave, as a positive number, else 0: (n, 1)."""
    import numpy as np

    values = np.negative(curvature_values(hits, inputs))
    return np.maximum(values, 0.0, out=values)


def object_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Id of the high-poly group at each hit, from 1 on: (n, 1); 1 without groups."""
    return _ids_of_hits(hits, inputs.high.face_groups, inputs.options.threads)


def object_names(inputs: BakeInputs) -> tuple[str, ...]:
    """Return the names of the groups, or that of the mesh where there are none."""
    high = inputs.high
    return (high.name,) if high.face_groups is None else high.group_names


def material_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Id of the material at each hit, from 1 on: (n, 1); of the group where there are none."""
    if inputs.materials is None:
        return object_id_values(hits, inputs)
    return _ids_of_hits(hits, inputs.materials.face_materials, inputs.options.threads)


def material_names(inputs: BakeInputs) -> tuple[str, ...]:
    """Return the names of the materials, or those of the groups where there are none."""
    return object_names(inputs) if inputs.materials is None else inputs.materials.names


def _ids_of_hits(hits: Hits, face_ids: IntArray | None, threads: int | None) -> Float32Array:
    """Ids of the faces hit, from 1 on: (n, 1) float32; `face_ids` (F,) count from 0."""

    def look_up(some: Hits, ids: Float32Array) -> None:
        ids[:, 0] = 1 if face_ids is None else face_ids[some.high_faces] + 1

    return hits.computed(1, look_up, threads)


def vertex_color_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vertex color at each hit, interpolated in linear light: (n, 3) float32."""
    high = inputs.high_surface
    return hits.interpolated(high.colors, high.mesh.faces, inputs.options.threads)


def require_colors(inputs: BakeInputs) -> None:
    """Raise `MeshError` if the high-poly mesh has no vertex colors."""
    if inputs.high.colors is None:
        raise MeshError(
            f"{inputs.high.name}: it has no vertex colors to bake; leave vertex-color out of "
            "`maps`, or give a high-poly mesh that has them"
        )


KINDS = (
    MapKind("curvature", 1, "curvature", curvature_values, of_neighbors=True),
    MapKind("convexity", 1, "curvature", convexity_values, of_neighbors=True, mid=0.0),
    MapKind("concavity", 1, "curvature", concavity_values, of_neighbors=True, mid=0.0),
    MapKind("object-id", 1, "id", object_id_values, combine="first", legend_function=object_names),
    MapKind(
        "material-id", 1, "id", material_id_values, combine="first", legend_function=material_names
    ),
    MapKind(
        "vertex-color",
        3,
        "color",
        vertex_color_values,
        hides_misses=True,
        require_function=require_colors,
    ),
    *_CHANNELS,
)
