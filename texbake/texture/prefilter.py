"""Lighting from a cube map: irradiance, reflections by roughness, and the split-sum table.

Based on: Karis, "Real Shading in Unreal Engine 4", 2013, for levels by roughness with the normal as
the viewing direction, and for the split sum; Walter et al., "Microfacet Models for Refraction
through Rough Surfaces", 2007, for GGX; Krivanek and Colbert, "Real-time Shading with Filtered
Importance Sampling", 2008, for reading each sample from a level as wide as its share of directions;
Hammersley points after Dammertz, "Hammersley Points on the Hemisphere", 2012, so that the result is
the same each time; Duff et al., "Building an Orthonormal Basis, Revisited", 2017.

Irradiance is integrated, not projected onto spherical harmonics, whose nine coefficients ring
around a small bright sun and can become negative.

The split-sum table departs from Karis in the masking and shadowing of microfacets, which are
Smith's, height-correlated, as in the BRDF of glTF 2.0 (Heitz, "Understanding the Masking-Shadowing
Function in Microfacet-Based BRDFs", 2014), and in that only visible facets are sampled (Heitz,
"Sampling the GGX Distribution of Visible Normals", 2018), so that the weight of a sample stays
below 1 and few samples are enough. Kernel: `core/cube_maps.c`.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import require_least
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.parallel import run_bands
from texbake.texture.cube_map import (
    CubeChain,
    CubeMap,
    cube_chain,
    resize_cube,
    shrink_cube,
    solid_angles,
    texel_directions,
)

# Texels of the result per band.
_BAND = 256

# Detail of 1/32 of a face, about 3 degrees, is negligible for a cosine lobe of 180 degrees.
_IRRADIANCE_SOURCE = 32
_MOST_SAMPLES = 4096

# Samples are moved outwards in the lobe, from 1 - u to its third power, and weighted by the
# derivative. Much of the light in a studio comes through the long tail of GGX, where plain
# importance sampling places only a few percent of the samples: with two lamps, powers of 1, 2 and 3
# gave errors of 69, 22 and 18 % (relative root mean square, including dark directions; roughness
# 0.2, 256 samples).
_TAIL_POWER = 3


def irradiance(cube: CubeMap, *, size: int = 32, threads: int | None = None) -> CubeMap:
    """Cube map of mean radiance over the hemisphere of a normal, weighted by cosine."""
    require_least("size", size)
    source = shrink_cube(cube, min(cube.size, _IRRADIANCE_SOURCE), threads=threads)
    normals = texel_directions(size).reshape(-1, 3)
    directions = texel_directions(source.size).reshape(-1, 3)
    angles = np.tile(solid_angles(source.size).ravel(), 6)
    radiance = np.ascontiguousarray(source.faces).reshape(-1, cube.n_channels)
    out = np.empty((len(normals), cube.n_channels), np.float32)
    work = partial(core.average_hemispheres, directions, angles, radiance, normals, out)
    run_bands(work, len(normals), band=_BAND, threads=threads)
    return CubeMap(out.reshape(6, size, size, -1))


def specular_levels(
    cube: CubeMap,
    *,
    n_levels: int = 6,
    size: int = 256,
    samples: int = 1024,
    threads: int | None = None,
) -> CubeChain:
    """Prefilter a cube map for reflections; level i is for roughness i / (n_levels - 1)."""
    require_least("n_levels", n_levels)
    require_least("size", size)
    require_least("samples", samples, 16)
    mirror = resize_cube(cube, size, threads=threads)
    source = cube_chain(mirror, threads=threads)
    levels = [mirror]
    for index in range(1, n_levels):
        n_samples = max(samples, min(samples << (index - 1), _MOST_SAMPLES))
        lobe = _lobe(index / (n_levels - 1), n_samples, source)
        levels.append(_rough(source, lobe, max(size >> index, 1), threads))
    return CubeChain.of(levels)


def hammersley(n_points: int) -> FloatArray:
    """Return evenly spread points (n, 2) in the unit square: (i + 1/2) / n, and i bit-reversed.

    >>> hammersley(4).tolist()
    [[0.125, 0.0], [0.375, 0.5], [0.625, 0.25], [0.875, 0.75]]
    """
    index = np.arange(n_points, dtype=np.uint32)
    reverse = np.zeros(n_points)
    for bit in range(32):
        reverse += (index >> np.uint32(bit) & np.uint32(1)) * math.ldexp(1.0, -bit - 1)
    return np.stack([(np.arange(n_points) + 0.5) / n_points, reverse], axis=1)


def _lobe(roughness: float, samples: int, source: CubeChain) -> FloatArray:
    """(n, 5): x, y, z, level of the source and weight, for a lobe seen along its normal, z."""
    points = hammersley(samples)
    alpha2 = roughness**4
    rest = pm.power(1 - points[:, 0], _TAIL_POWER)
    widened = _TAIL_POWER * pm.power(1 - points[:, 0], _TAIL_POWER - 1)
    turn = 2 * np.pi * points[:, 1]
    cosine2 = rest / (1 + (alpha2 - 1) * (1 - rest))
    sine2 = alpha2 * (1 - rest) / (1 + (alpha2 - 1) * (1 - rest))
    # Reflect the view at the half vector, which doubles the angle to the normal.
    sine = 2 * np.sqrt(cosine2 * sine2)
    cosine = cosine2 - sine2
    # Density of the reflected directions, D (n·h) / (4 v·h), where v is the normal.
    density = alpha2 / (4 * np.pi * (cosine2 * (alpha2 - 1) + 1) ** 2) / widened
    per_texel = 4 * np.pi / (6.0 * source.size**2)
    # One level more, as the authors advise: samples overlap, so bright lamps leave no pattern.
    level = np.floor(0.5 * pm.log2(1 / (samples * density) / per_texel) + 1.5)
    level = np.clip(level, 0, source.n_levels - 1)
    lobe = [sine * pm.cos(turn), sine * pm.sin(turn), cosine, level, cosine * widened]
    return np.ascontiguousarray(np.stack(lobe, axis=1)[cosine > 0])


def _rough(source: CubeChain, lobe: FloatArray, size: int, threads: int | None) -> CubeMap:
    """Average a cube map over a lobe about the direction of each texel."""
    normals = texel_directions(size).reshape(-1, 3)
    out = np.empty((len(normals), source.n_channels), np.float32)
    work = partial(
        core.average_lobes, source.texels, source.offsets, source.sizes, lobe, normals, out
    )
    run_bands(work, len(normals), band=_BAND, threads=threads)
    return CubeMap(out.reshape(6, size, size, -1))


_TABLE_SAMPLES = 512
_RIM_POWER = 3


@lru_cache(maxsize=4)
def split_sum_table(size: int = 64) -> Float32Array:
    """(size, size, 2) scale and bias of F0, by roughness in rows and n·v in columns."""
    require_least("size", size)
    centers = (np.arange(size) + 0.5) / size
    rows = [_scales_and_biases(roughness**2, centers) for roughness in centers]
    table: Float32Array = np.array(rows, np.float32)
    table.flags.writeable = False
    return table


def _scales_and_biases(alpha: float, cosines: FloatArray) -> FloatArray:
    """Return scale and bias (n, 2) by n·v in (0, 1]."""
    points = hammersley(_TABLE_SAMPLES)
    view_z = cosines[:, None]
    view_x = np.sqrt(1 - view_z**2)
    # The view direction in the space in which the facets are a hemisphere.
    length = pm.hypot(alpha * view_x, view_z)
    high_x, high_z = alpha * view_x / length, view_z / length
    # Points on the projected disk of the hemisphere, part of which is hidden from the view. There
    # are more of them, with smaller weights, near the rim, which is the long tail of GGX.
    rest, turn = pm.power(1 - points[:, 0], _RIM_POWER), 2 * np.pi * points[:, 1]
    share = _RIM_POWER * pm.power(1 - points[:, 0], _RIM_POWER - 1)
    radius = np.sqrt(1 - rest)
    t1, t2 = radius * pm.cos(turn), radius * pm.sin(turn)
    seen = 0.5 * (1 + high_z)
    t2 = (1 - seen) * np.sqrt(1 - t1**2) + seen * t2
    t3 = np.sqrt(np.maximum(0, 1 - t1**2 - t2**2))
    # The first axis is y, the second the view rotated by a quarter turn about y. The facet normal
    # is then stretched back.
    half_x = alpha * (-high_z * t2 + high_x * t3)
    half_y = alpha * np.broadcast_to(t1, half_x.shape)
    half_z = np.maximum(high_x * t2 + high_z * t3, 0)
    length = np.sqrt(half_x**2 + half_y**2 + half_z**2)
    view_half = (view_x * half_x + view_z * half_z) / length
    light_z = 2 * view_half * half_z / length - view_z
    lit = light_z > 0
    # Share of the visible facets that the light reaches: G2 / G1.
    view_root = _root(alpha, view_z)
    light_root = _root(alpha, np.where(lit, light_z, 1.0))
    weight = np.where(
        lit, light_z * (view_root + view_z) / (light_z * view_root + view_z * light_root), 0
    )
    away = np.clip(1 - view_half, 0, 1)
    fresnel = (away * away) * (away * away) * away
    weight = weight * share / share.mean()
    return np.stack([(weight * (1 - fresnel)).mean(1), (weight * fresnel).mean(1)], axis=1)


def _root(alpha: float, cosine: FloatArray) -> FloatArray:
    """Return the square root in Smith's functions for GGX."""
    root: FloatArray = np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2)
    return root
