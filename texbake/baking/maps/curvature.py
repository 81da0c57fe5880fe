"""How the dense surface bends: ridges above the middle level, grooves below it.

The values are mean curvatures of the dense mesh's vertices (see `texbake.mesh.normals`), found
once and interpolated over its faces. Convexity and concavity are the two halves as maps of their
own.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.on_surface import between_corners
from texbake.baking.options import BakeOptions


def curvature_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean curvature at each hit, in one by model units, positive where convex: (n, 1)."""
    return between_corners(hits, inputs.high_curvatures, inputs.high.faces, inputs.options.threads)


def convexity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is convex, else 0: (n, 1)."""
    values = curvature_values(hits, inputs)
    return np.maximum(values, 0.0, out=values)


def concavity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Curvature where it is hollow, as a positive number, else 0: (n, 1)."""
    values = np.negative(curvature_values(hits, inputs))
    return np.maximum(values, 0.0, out=values)


def _neutral(_: BakeOptions) -> tuple[float, ...]:
    return (0.0,)


CURVATURE = MapKind("curvature", 1, "curvature", curvature_values, _neutral)
CONVEXITY = MapKind("convexity", 1, "curvature", convexity_values, _neutral, mid=0.0)
CONCAVITY = MapKind("concavity", 1, "curvature", concavity_values, _neutral, mid=0.0)
