"""The direction from which most light reaches the dense surface: its normal, bent to the open side.

It is the mean of the directions that meet nothing, weighted by the cosine to the dense normal as
ambient occlusion is, in the space of normals that the options ask for.

Based on: Landis, "Production-Ready Global Illumination", 2002.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.normal import NORMAL, to_tangent_space
from texbake.baking.secondary.rays import OUTER, met_by
from texbake.raycast.fans import OPEN_DIRECTION


def bent_normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit direction of the mean of each hit's open ones: (n, 3) float32.

    The dense normal where none is open; flat, (0, 0, 1), where the light mesh's frame is singular.
    """
    values = met_by(hits, OPEN_DIRECTION, "bent-normal")
    if inputs.options.space == "tangent":
        values = np.ascontiguousarray(values)
        to_tangent_space(hits, inputs, values, normalize=True)
        return values
    lengths = np.linalg.norm(values, axis=1, keepdims=True)
    return np.asarray(values / np.where(lengths > 0.0, lengths, np.float32(1.0)))


BENT_NORMAL = MapKind(
    "bent-normal",
    3,
    "normal",
    bent_normal_values,
    NORMAL.neutral,
    combine="unit mean",
    needs=OUTER,
)
