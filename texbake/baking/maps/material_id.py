"""Which material of the dense mesh was hit; its groups where nothing is known of materials."""

from __future__ import annotations

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.object_id import no_id, object_id_values, object_names
from texbake.baking.maps.on_surface import numbers_of_faces


def material_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Number of the material of each hit's face, from 1 on: (n, 1)."""
    if inputs.materials is None:
        return object_id_values(hits, inputs)
    return numbers_of_faces(hits, inputs.materials.face_materials, inputs.options.threads)


def material_names(inputs: BakeInputs) -> tuple[str, ...]:
    """Names of the materials, or of the groups that stand for them."""
    return object_names(inputs) if inputs.materials is None else inputs.materials.names


MATERIAL_ID = MapKind(
    "material-id", 1, "id", material_id_values, no_id, combine="first", legend=material_names
)
