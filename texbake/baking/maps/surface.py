"""Maps of what the high-poly surface carries: ids, vertex colors, curvature, and opacity."""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.per_hit import Float32Array, interpolated, per_hit
from texbake.errors import MeshError
from texbake.mesh.mesh import IntArray
from texbake.raycast.rays import NO_HIT

# Ids


def _ids_of_hits(hits: Hits, face_ids: IntArray, threads: int | None) -> Float32Array:
    """Ids of the faces hit, from 1 on: (n, 1) float32; `face_ids` (F,) count from 0."""

    def look_up(some: Hits, ids: Float32Array) -> None:
        np.add(face_ids[some.high_faces], 1, out=ids[:, 0], casting="unsafe")

    return per_hit(hits, 1, look_up, threads)


def object_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Id of the group of the high-poly mesh at each hit, from 1 on: (n, 1); 1 without groups.

    Groups are the objects and groups of OBJ files and the nodes of glTF files.
    """
    groups = inputs.high.face_groups
    if groups is None:
        return np.ones((len(hits), 1), dtype=np.float32)
    return _ids_of_hits(hits, groups, inputs.options.threads)


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


# Colors


def vertex_color_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vertex color at each hit, interpolated in linear light: (n, 3) float32."""
    return interpolated(hits, inputs.high_surface.colors, inputs.high.faces, inputs.options.threads)


def require_colors(inputs: BakeInputs) -> None:
    """Raise `MeshError` if the high-poly mesh has no vertex colors."""
    if inputs.high.colors is None:
        raise MeshError(
            f"{inputs.high.name}: it has no vertex colors to bake; leave vertex-color out of "
            "`maps`, or give a high-poly mesh that has them"
        )


# Curvature and opacity


def curvature_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean curvature at each hit, per model unit, positive where convex: (n, 1).

    Computed once at the vertices of the high-poly mesh (see `texbake.mesh.normals`) and
    interpolated over its faces.
    """
    return interpolated(
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
