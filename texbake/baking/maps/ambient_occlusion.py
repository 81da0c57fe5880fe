"""How much of its surroundings the dense surface sees: where dirt gathers and light does not reach.

The value is the share of the hemisphere, weighted by the cosine to the normal, from which light
comes in: 1 for a convex surface, 1/2 everywhere in a hemispherical bowl.

Based on: Zhukov, Iones, Kronin, "An Ambient Light Illumination Model", 1998; Landis, "Production-
Ready Global Illumination", 2002, for the name and the bent normal that goes with it.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.secondary.rays import OUTER, met_by
from texbake.raycast.fans import OPEN


def ambient_occlusion_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Open share of each hit's hemisphere: (n, 1) float32 in [0, 1], 1 where nothing is near."""
    return np.ascontiguousarray(met_by(hits, OPEN, "ao")[:, np.newaxis])


AMBIENT_OCCLUSION = MapKind(
    "ao", 1, "mask", ambient_occlusion_values, lambda options: (1.0,), needs=OUTER
)
