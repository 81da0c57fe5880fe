"""How much of the light about its mirrored direction a rough surface reflects: the split-sum table.

Based on: Karis, "Real Shading in Unreal Engine 4", 2013. Departs from it in the masking and
shadowing of microfacets, which are Smith's, height-correlated, as in the BRDF of glTF 2.0 (Heitz,
"Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", 2014), and in that only
facets that are seen are sampled (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018),
so that a sample's weight stays below 1 and few are enough.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.texture.prefilter import hammersley

_SAMPLES = 512
_RIM_POWER = 3


@lru_cache(maxsize=4)
def split_sum_table(size: int = 64) -> npt.NDArray[np.float32]:
    """Scale and bias of F0 by the cosine to the eye and the roughness.

    A surface with the specular color F0 reflects F0 scale + bias of prefiltered light.

    Parameters
    ----------
    size
        Rows and columns.

    Returns
    -------
    (size, size, 2) float32
        [row, column] is for roughness (row + 0.5) / size and n·v = (column + 0.5) / size: texel
        centers. Read-only; computed once a process.

    Raises
    ------
    OptionError
        The size is below 1.
    """
    if size < 1:
        raise OptionError(f"size: {size} is too small; it must be at least 1")
    centers = (np.arange(size) + 0.5) / size
    rows = [_scales_and_biases(roughness**2, centers) for roughness in centers]
    table: npt.NDArray[np.float32] = np.array(rows, np.float32)
    table.flags.writeable = False
    return table


def _scales_and_biases(alpha: float, cosines: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Scale and bias (n, 2) by the cosine of the view with the normal, in (0, 1]."""
    points = hammersley(_SAMPLES)
    view_z = cosines[:, None]
    view_x = np.sqrt(1 - view_z**2)
    # The view in the space in which the facets are a hemisphere.
    length = np.hypot(alpha * view_x, view_z)
    high_x, high_z = alpha * view_x / length, view_z / length
    # Points on the disk of the hemisphere as the view sees it, part of which is hidden.
    # More of them, of less weight each, near its rim, which stands for the long tail of GGX.
    rest, turn = (1 - points[:, 0]) ** _RIM_POWER, 2 * np.pi * points[:, 1]
    share = _RIM_POWER * (1 - points[:, 0]) ** (_RIM_POWER - 1)
    radius = np.sqrt(1 - rest)
    t1, t2 = radius * np.cos(turn), radius * np.sin(turn)
    seen = 0.5 * (1 + high_z)
    t2 = (1 - seen) * np.sqrt(1 - t1**2) + seen * t2
    t3 = np.sqrt(np.maximum(0, 1 - t1**2 - t2**2))
    # First axis y, second axis the view turned a quarter about it; then the facet stretched back.
    half_x = alpha * (-high_z * t2 + high_x * t3)
    half_y = alpha * np.broadcast_to(t1, half_x.shape)
    half_z = np.maximum(high_x * t2 + high_z * t3, 0)
    length = np.sqrt(half_x**2 + half_y**2 + half_z**2)
    view_half = (view_x * half_x + view_z * half_z) / length
    light_z = 2 * view_half * half_z / length - view_z
    lit = light_z > 0
    # Of facets that the eye sees, those that the light reaches too: G2 / G1.
    view_root = _root(alpha, view_z)
    light_root = _root(alpha, np.where(lit, light_z, 1.0))
    weight = np.where(
        lit, light_z * (view_root + view_z) / (light_z * view_root + view_z * light_root), 0
    )
    fresnel = np.clip(1 - view_half, 0, 1) ** 5
    weight = weight * share / share.mean()
    return np.stack([(weight * (1 - fresnel)).mean(1), (weight * fresnel).mean(1)], axis=1)


def _root(alpha: float, cosine: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Root in Smith's functions of GGX."""
    root: npt.NDArray[np.float64] = np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2)
    return root
