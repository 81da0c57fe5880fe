"""Which part of the dense mesh was hit: its groups, as objects and groups of OBJ, nodes of glTF."""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.on_surface import numbers_of_faces
from texbake.baking.options import BakeOptions


def object_id_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Number of the group of each hit's face, from 1 on; 1 for a mesh without groups: (n, 1)."""
    groups = inputs.high.face_groups
    if groups is None:
        return np.ones((len(hits), 1), dtype=np.float32)
    return numbers_of_faces(hits, groups, inputs.options.threads)


def object_names(inputs: BakeInputs) -> tuple[str, ...]:
    """Names of the groups; that of a mesh without any."""
    high = inputs.high
    return (high.name,) if high.face_groups is None else high.group_names


def no_id(_: BakeOptions) -> tuple[float, ...]:
    """Return the number of nothing."""
    return (0.0,)


OBJECT_ID = MapKind(
    "object-id", 1, "id", object_id_values, no_id, combine="first", legend=object_names
)
