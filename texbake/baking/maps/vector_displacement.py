"""The whole way from the light surface to the dense one, as a vector: overhangs as well."""

from __future__ import annotations

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.normal import to_tangent_space


def vector_displacement_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Vector in model units from the light surface to each hit: (n, 3) float32.

    In tangent space x T + y B + z N is that vector, with T, B and N as they are interpolated.
    """
    values = hits.offsets.copy()
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=False)
    return values


VECTOR_DISPLACEMENT = MapKind(
    "vector-displacement", 3, "vector", vector_displacement_values, lambda options: (0.0, 0.0, 0.0)
)
