"""Where there is a dense surface at all: the share of a texel's samples that hit it."""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.raycast.rays import NO_HIT


def opacity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """1 for a hit, 0 for a miss: (n, 1) float32."""
    values: Float32Array = (hits.high_faces != NO_HIT).astype(np.float32)
    return values[:, np.newaxis]


OPACITY = MapKind("opacity", 1, "mask", opacity_values, lambda options: (0.0,), of_misses=True)
