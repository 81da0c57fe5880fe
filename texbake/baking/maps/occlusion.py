"""Maps of what rays from the hits meet: ambient occlusion, bent normals and thickness.

Based on: Zhukov, Iones, Kronin, "An Ambient Light Illumination Model", 1998; Landis, "Production-
Ready Global Illumination", 2002, for the name ambient occlusion and for bent normals.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.normals import to_tangent_space
from texbake.baking.maps.per_hit import Float32Array
from texbake.baking.secondary_rays import secondary_values
from texbake.core import portable_math as pm
from texbake.raycast.hemispheres import DEPTH, OPEN, OPEN_DIRECTION


def ambient_occlusion_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Open share of the hemisphere above each hit: (n, 1) float32 in [0, 1].

    Weighted by the cosine of the angle to the normal: 1 for a convex surface, 1/2 everywhere in a
    hemispherical bowl.
    """
    return np.ascontiguousarray(secondary_values(hits, OPEN, "ao")[:, np.newaxis])


def bent_normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit vector of the mean open direction above each hit: (n, 3) float32.

    The mean is weighted as for ambient occlusion, and the vector is in the space of normals that
    the options specify. It is the high-poly normal where no direction is open, and flat, (0, 0, 1),
    where the tangent frame is singular.
    """
    values = secondary_values(hits, OPEN_DIRECTION, "bent-normal")
    if inputs.options.space == "tangent":
        values = np.ascontiguousarray(values)
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
    return np.ascontiguousarray(secondary_values(hits, DEPTH, "thickness")[:, np.newaxis])
