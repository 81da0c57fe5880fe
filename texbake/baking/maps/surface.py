"""Maps of what the high-poly surface carries: ids, colors, textures, curvature, and opacity.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.options import BakeOptions
from texbake.core import core
from texbake.errors import MeshError
from texbake.mesh.materials import BaseColor
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT
from texbake.texture.lookup import lookup

_BAND = 1 << 15
_WHITE = (1.0, 1.0, 1.0)


def _black(_: BakeOptions) -> tuple[float, ...]:
    return (0.0, 0.0, 0.0)


def _zero(_: BakeOptions) -> tuple[float, ...]:
    return (0.0,)


def _interpolate(
    hits: Hits, values: Float32Array, corners: IntArray, threads: int | None
) -> Float32Array:
    """Values of corners, interpolated linearly at the hits: (n, C) float32.

    Parameters
    ----------
    values : (N, C) float32
        Read-only.
    corners : (F, 3) int32
        Row of each corner of the high-poly faces; read-only.
    """
    found = np.empty((len(hits), values.shape[1]), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.interpolate_corners(
            hits.high_faces[band], hits.high_barycentrics[band], values, corners, found[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found


# Ids


def _ids_of_hits(hits: Hits, face_ids: IntArray, threads: int | None) -> Float32Array:
    """Ids of the faces hit, from 1 on: (n, 1) float32; `face_ids` (F,) count from 0."""
    found = np.empty((len(hits), 1), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        np.add(face_ids[hits.high_faces[start:stop]], 1, out=found[start:stop, 0], casting="unsafe")

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found


def object_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Id of the group of the high-poly mesh at each hit, from 1 on: (n, 1); 1 without groups.

    Groups are the objects and groups of OBJ files and the nodes of glTF files.
    """
    groups = inputs.high.face_groups
    if groups is None:
        return np.ones((len(hits), 1), dtype=np.float32)
    return _ids_of_hits(hits, groups, inputs.options.threads)


def _object_names(inputs: BakeInputs) -> tuple[str, ...]:
    high = inputs.high
    return (high.name,) if high.face_groups is None else high.group_names


def material_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Id of the material at each hit, from 1 on: (n, 1); of the group where there are none."""
    if inputs.materials is None:
        return object_id_values(hits, inputs)
    return _ids_of_hits(hits, inputs.materials.face_materials, inputs.options.threads)


def _material_names(inputs: BakeInputs) -> tuple[str, ...]:
    return _object_names(inputs) if inputs.materials is None else inputs.materials.names


# Colors


def vertex_color_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vertex color at each hit, interpolated in linear light: (n, 3) float32."""
    return _interpolate(hits, inputs.high_surface.colors, inputs.high.faces, inputs.options.threads)


def _require_colors(inputs: BakeInputs) -> None:
    if inputs.high.colors is None:
        raise MeshError(
            f"{inputs.high.name}: it has no vertex colors to bake; leave vertex-color out of "
            "`maps`, or give a high-poly mesh that has them"
        )


def texture_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Linear base color at each hit: (n, 3) float32.

    White for a material without a known color. Images are looked up at each hit, bilinearly and in
    linear light.
    """
    assert inputs.materials is not None
    colors = inputs.materials.base_colors
    if len(colors) == 1:
        return _base_colors(hits.high_faces, hits.high_barycentrics, inputs, colors[0])
    values = np.empty((len(hits), 3), dtype=np.float32)
    ids = inputs.materials.face_materials[hits.high_faces]
    for i, color in enumerate(colors):
        rows = np.flatnonzero(ids == i)
        values[rows] = _base_colors(
            hits.high_faces[rows], hits.high_barycentrics[rows], inputs, color
        )
    return values


def _base_colors(
    faces: IntArray, barycentrics: Float32Array, inputs: BakeInputs, color: BaseColor | None
) -> Float32Array:
    """(n, 3) float32: the color of one material at points of faces that have it."""
    factor = np.array(_WHITE if color is None else color.factor, dtype=np.float32)
    if color is None or color.image is None:
        return np.tile(factor, (len(faces), 1))
    coordinates = _image_coordinates(faces, barycentrics, inputs, color)
    image = inputs.high_surface.images[color.image_name]
    found = lookup(image, coordinates, wrap=color.wrap, threads=inputs.options.threads)
    return found if color.factor == _WHITE else found * factor


def _image_coordinates(
    faces: IntArray, barycentrics: Float32Array, inputs: BakeInputs, color: BaseColor
) -> FloatArray:
    """(n, 2) float64: texture coordinates in the image of a material."""
    coordinates = np.empty((len(faces), 2))
    placing = np.array(color.placing)
    uvs, corners = inputs.high.uvs, inputs.high.uv_faces

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.place_in_image(
            faces[band], barycentrics[band], uvs, corners, placing, coordinates[band]
        )

    run_bands(work, len(faces), band=_BAND, threads=inputs.options.threads)
    return coordinates


def _require_materials(inputs: BakeInputs) -> None:
    high, materials = inputs.high, inputs.materials
    colors = () if materials is None else materials.base_colors
    if not any(color is not None for color in colors):
        raise MeshError(
            f"{high.name}: its file names no base color to bake; give its image as "
            "`high_texture`, or leave texture out of `maps`"
        )
    if high.uvs is None and any(color is not None and color.image for color in colors):
        raise MeshError(
            f"{high.name}: it has no texture coordinates, which its image needs; "
            "leave texture out of `maps`"
        )


# Curvature and opacity


def curvature_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean curvature at each hit, per model unit, positive where convex: (n, 1).

    Computed once at the vertices of the high-poly mesh (see `texbake.mesh.normals`) and
    interpolated over its faces.
    """
    return _interpolate(
        hits, inputs.high_surface.curvatures, inputs.high.faces, inputs.options.threads
    )


def convexity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is convex, else 0: (n, 1)."""
    values = curvature_values(hits, inputs)
    return np.maximum(values, 0.0, out=values)


def concavity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is concave, as a positive number, else 0: (n, 1)."""
    values = np.negative(curvature_values(hits, inputs))
    return np.maximum(values, 0.0, out=values)


def opacity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """1 for a hit, 0 for a miss, so that a texel gets the share of its samples that hit: (n, 1)."""
    values: Float32Array = (hits.high_faces != NO_HIT).astype(np.float32)
    return values[:, np.newaxis]


OBJECT_ID = MapKind(
    "object-id", 1, "id", object_id_values, _zero, combine="first", legend=_object_names
)
MATERIAL_ID = MapKind(
    "material-id", 1, "id", material_id_values, _zero, combine="first", legend=_material_names
)
VERTEX_COLOR = MapKind(
    "vertex-color",
    3,
    "color",
    vertex_color_values,
    _black,
    hides_misses=True,
    require=_require_colors,
)
TEXTURE = MapKind(
    "texture", 3, "color", texture_values, _black, hides_misses=True, require=_require_materials
)
CURVATURE = MapKind("curvature", 1, "curvature", curvature_values, _zero, of_neighbors=True)
CONVEXITY = MapKind(
    "convexity", 1, "curvature", convexity_values, _zero, of_neighbors=True, mid=0.0
)
CONCAVITY = MapKind(
    "concavity", 1, "curvature", concavity_values, _zero, of_neighbors=True, mid=0.0
)
OPACITY = MapKind("opacity", 1, "mask", opacity_values, _zero, of_misses=True)
