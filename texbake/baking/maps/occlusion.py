"""Maps of what rays meet: opacity, and ambient occlusion, bent normals and thickness from the hits.

Based on: Zhukov, Iones, Kronin, "An Ambient Light Illumination Model", 1998; Landis, "Production-
Ready Global Illumination", 2002, for the name ambient occlusion and for bent normals.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.maps.geometry import to_tangent_space
from texbake.baking.maps.kind import FLAT, INNER, OUTER, MapKind
from texbake.errors import OptionError

if TYPE_CHECKING:
    from texbake.baking.hits import Float32Array, Hits
    from texbake.baking.inputs import BakeInputs

# Measured with 64 rays: 0.057 sqrt(v (1 - v)) of ao, for all v; 1.7 % of thickness.
_NOISE_OF_SHARES, _RELATIVE_NOISE = 1.3, 0.4


def opacity_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """1 for a hit, 0 for a miss, so that a texel gets the share of its samples that hit: (n, 1)."""
    import numpy as np

    return hits.is_hit.astype(np.float32)[:, np.newaxis]


def ambient_occlusion_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Open share of the hemisphere above each hit: (n, 1) float32 in [0, 1].

    Weighted by the cosine of the angle to the normal: 1 for a convex surface, 1/2 everywhere in a
    hemispherical bowl.
    """
    from texbake.raycast.rays import OPEN

    return _met(hits, slice(OPEN, OPEN + 1), "ao")


def bent_normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit vector of the mean open direction above each hit: (n, 3) float32.

    The mean is weighted as for ambient occlusion, and the vector is in the space of normals that
    the options specify. It is the high-poly normal where no direction is open, and flat, (0, 0, 1),
    where the tangent frame is singular.
    """
    import numpy as np

    from texbake.core import portable_math as pm
    from texbake.raycast.rays import OPEN_DIRECTION

    values = _met(hits, OPEN_DIRECTION, "bent-normal")
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=True)
        return values
    lengths = pm.norm(values, axis=1, keepdims=True)
    return np.asarray(values / np.where(lengths > 0.0, lengths, np.float32(1.0)))


def thickness_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Mean distance through the inside below each hit: (n, 1) float32, in model units.

    The mean over the hemisphere below the surface, weighted by the cosine of the angle to the
    normal. So a ball of radius r is 4/3 r thick everywhere, and the mean over the surface of any
    convex body is 4 times its volume divided by its surface area (Cauchy's mean chord theorem). A
    ray that meets no far side counts with its full length.
    """
    from texbake.raycast.rays import DEPTH

    return _met(hits, slice(DEPTH, DEPTH + 1), "thickness")


def _met(hits: Hits, columns: slice, name: str) -> Float32Array:
    """Return a copy of some columns of `Hits.secondary`; errors name the map."""
    import numpy as np

    met = None if hits.secondary is None else hits.secondary[:, columns].copy()
    if met is None or np.isnan(met).any():
        raise OptionError(
            f"{name}: the kept hits lack the rays for it; bake with it among the maps"
        )
    return met


KINDS = (
    MapKind("opacity", 1, "mask", opacity_values, of_misses=True, plain=(1.0,)),
    MapKind(
        "ao",
        1,
        "mask",
        ambient_occlusion_values,
        needs=OUTER,
        noise=(_NOISE_OF_SHARES, 0.0),
        empty=1.0,
        plain=(1.0,),
    ),
    MapKind(
        "bent-normal", 3, "normal", bent_normal_values, combine="unit mean", needs=OUTER, plain=FLAT
    ),
    MapKind(
        "thickness", 1, "thickness", thickness_values, needs=INNER, noise=(0.0, _RELATIVE_NOISE)
    ),
)
