"""How thick the dense mesh is below its surface: where light shines through, and where it does not.

The value is the mean way through the inside, over the hemisphere below the surface and weighted by
the cosine to the normal, in model units. So a ball of radius r is 4/3 r thick everywhere, and the
mean over the surface of any convex body is 4 times its volume by that surface (Cauchy's theorem of
the mean chord). A ray that meets no far side counts as long as rays go.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.secondary.rays import INNER, met_by
from texbake.raycast.fans import DEPTH


def thickness_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean way through the inside below each hit: (n, 1) float32 in model units."""
    return np.ascontiguousarray(met_by(hits, DEPTH, "thickness")[:, np.newaxis])


THICKNESS = MapKind(
    "thickness", 1, "thickness", thickness_values, lambda options: (0.0,), needs=INNER
)
