"""Maps as functions of hits: the high-poly surface, its attributes, and what rays meet there.

Normals, heights over the low-poly mesh and positions come from the hits; opacity, ambient
occlusion, bent normals and thickness from rays. Each channel of materials has a map, except for the
normal; `baking/channel_images.py` looks up images, bilinearly and in linear light.

Where a material of the high-poly mesh has a normal map of its own, the shading normal is that of
the map, in the tangent space of the high-poly mesh.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008: a renderer computes
x T + y B + z N from the interpolated tangent and normal without renormalizing them, with
B = w cross(N, T). So the frame is inverted exactly as it is, and only the result is normalized.
Zhukov, Iones, Kronin, "An Ambient Light Illumination Model", 1998; Landis, "Production-Ready Global
Illumination", 2002, for the name ambient occlusion and for bent normals.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.maps.kind import FLAT, INNER, OUTER, MapKind
from texbake.errors import MeshError, OptionError

if TYPE_CHECKING:
    from texbake.baking.hits import Hits
    from texbake.baking.inputs import BakeInputs
    from texbake.mesh.mesh import Float32Array, IntArray


def normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit high-poly normals in the options' space; flat where the tangent frame is singular."""
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
    """Distance from the low-poly surface along its smooth normal: (n, 1), in model units."""
    from texbake.core import core

    normals, corners = inputs.low_surface.displacement_normals

    def measure(some: Hits, values: Float32Array) -> None:
        core.measure_displacements(
            some.low_faces, some.low_barycentrics, some.offsets, normals, corners, values
        )

    return hits.computed(1, measure, inputs.options.threads)


def vector_displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vector from the low-poly surface to each hit, (n, 3) model units, along xyz or T, B, N."""
    values = hits.offsets.copy()
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=False)
    return values


def position_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Point in model space of each hit: (n, 3) float32, each rounded once."""
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


# Measured with 64 rays: 0.057 sqrt(v (1 - v)) of ao, for all v; 1.7 % of thickness.
_NOISE_OF_SHARES, _RELATIVE_NOISE = 1.3, 0.4


def opacity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """1 for a hit, 0 for a miss, so that a texel gets the share of its samples that hit: (n, 1)."""
    import numpy as np

    return hits.is_hit.astype(np.float32)[:, np.newaxis]


def ambient_occlusion_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Open share of the hemisphere above each hit, weighted by the cosine: (n, 1) in [0, 1]."""
    from texbake.raycast.rays import OPEN

    return _met(hits, slice(OPEN, OPEN + 1), "ao")


def bent_normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """(n, 3) unit mean open direction above each hit, or its normal if none; space of normals."""
    import numpy as np

    from texbake.core import portable_math as pm
    from texbake.raycast.rays import OPEN_DIRECTION

    values = _met(hits, OPEN_DIRECTION, "bent-normal")
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=True)
        return values
    lengths = pm.norm(values, axis=1, keepdims=True)
    return np.asarray(values / np.where(lengths > 0.0, lengths, np.float32(1.0)))


def thickness_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean distance through the inside below each hit, cosine-weighted: (n, 1), in model units."""
    from texbake.raycast.rays import DEPTH

    return _met(hits, slice(DEPTH, DEPTH + 1), "thickness")


def _met(hits: Hits, columns: slice, name: str) -> Float32Array:
    """Return a copy of some columns of `Hits.secondary`; errors name the map."""
    import numpy as np

    met = None if hits.secondary is None else hits.secondary[:, columns].copy()
    if met is None or np.isnan(met).any():
        raise OptionError(
            f"{name}: the kept hits lack the rays for it; bake with it among the maps"
        )
    return met


RAY_KINDS = (
    MapKind("opacity", 1, "mask", opacity_values, of_misses=True, plain=(1.0,)),
    MapKind(
        "ao",
        1,
        "mask",
        ambient_occlusion_values,
        needs=OUTER,
        noise=(_NOISE_OF_SHARES, 0.0),
        empty=1.0,
        plain=(1.0,),
    ),
    MapKind(
        "bent-normal", 3, "normal", bent_normal_values, combine="unit mean", needs=OUTER, plain=FLAT
    ),
    MapKind(
        "thickness", 1, "thickness", thickness_values, needs=INNER, noise=(0.0, _RELATIVE_NOISE)
    ),
)


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


SURFACE_KINDS = (
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
