"""A cube map as light: what falls on a surface, and what surfaces of growing roughness mirror.

Based on: Karis, "Real Shading in Unreal Engine 4", 2013, for levels by roughness with the normal as
the direction of view; Walter et al., "Microfacet Models for Refraction through Rough Surfaces",
2007, for GGX; Krivanek and Colbert, "Real-time Shading with Filtered Importance Sampling", 2008,
for reading each sample from a level as wide as what it stands for; Hammersley points after
Dammertz, "Hammersley Points on the Hemisphere", 2012, so that the result is the same each time;
Duff et al., "Building an Orthonormal Basis, Revisited", 2017.

Diffuse light is integrated, and not projected on spherical harmonics (Ramamoorthi and Hanrahan, "An
Efficient Representation for Irradiance Environment Maps", 2001): their nine coefficients ring about
a small strong sun and can go below 0, while the sum over a small cube map is exact to its size and
costs a tenth of a second.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.cube_chain import CubeChain, cube_chain, reduced
from texbake.texture.cube_lookup import (
    bilinear_in_cell,
    cell_of,
    face_coordinates,
    resized,
)
from texbake.texture.cube_map import CubeMap, solid_angles, texel_directions

# Texels of the result a band.
_BAND = 256
# Light that varies within 1/32 of a face, about 3 degrees, is smooth to a cosine of 180 degrees.
_IRRADIANCE_SOURCE = 32
_MOST_SAMPLES = 4096
# Samples are moved outwards in the lobe, from 1 - u to its third power, and weighted by the
# derivative. Much of the light of a studio comes through the long tail of GGX, where plain
# importance sampling puts a few samples of a hundred: powers of 1, 2 and 3 left errors of 69, 22
# and 18 % (root mean square, relative, dark directions too; roughness 0.2, 256 samples) under two
# lamps.
_TAIL_POWER = 3


def irradiance(cube: CubeMap, *, size: int = 32, threads: int | None = None) -> CubeMap:
    """Light that falls on a diffuse surface by its normal, divided by pi.

    Parameters
    ----------
    cube
        Radiance by direction.
    size
        Texels along one side of the result, which is smooth: 16 to 64.

    Returns
    -------
    CubeMap
        Mean radiance over the hemisphere, weighted by cosine: a surface of color C_b reflects C_b
        times that. A constant environment gives its constant.

    Raises
    ------
    OptionError
        The size is below 1.
    """
    if size < 1:
        raise OptionError(f"size: {size} is too small; it must be at least 1")
    source = reduced(cube, min(cube.size, _IRRADIANCE_SOURCE), threads=threads)
    normals = texel_directions(size).reshape(-1, 3)
    directions = texel_directions(source.size).reshape(-1, 3)
    angles = np.tile(solid_angles(source.size).ravel(), 6)
    radiance = np.ascontiguousarray(source.faces).reshape(-1, cube.n_channels)
    radiance.flags.writeable = False
    out = np.empty((len(normals), cube.n_channels), np.float32)

    def work(start: int, stop: int) -> None:
        _irradiance_kernel(directions, angles, radiance, normals, out, start, stop)

    run_bands(work, len(normals), band=_BAND, threads=threads)
    return CubeMap(out.reshape(6, size, size, -1))


@kernel
def _irradiance_kernel(directions, angles, radiance, normals, out, start, stop):  # type: ignore[no-untyped-def]
    n_channels = radiance.shape[1]
    sums = np.zeros(n_channels)
    for i in range(start, stop):
        sums[:] = 0.0
        total = 0.0
        for j in range(len(directions)):
            cosine = (
                normals[i, 0] * directions[j, 0]
                + normals[i, 1] * directions[j, 1]
                + normals[i, 2] * directions[j, 2]
            )
            if cosine > 0.0:
                weight = cosine * angles[j]
                total += weight
                for channel in range(n_channels):
                    sums[channel] += weight * radiance[j, channel]
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / total


def specular_levels(
    cube: CubeMap,
    *,
    n_levels: int = 6,
    size: int = 256,
    samples: int = 1024,
    threads: int | None = None,
) -> CubeChain:
    """Levels that hold what a surface of growing roughness mirrors, by the mirrored direction.

    Parameters
    ----------
    cube
        Radiance by direction.
    n_levels
        Level i is for roughness i / (n_levels - 1), with alpha = roughness²; level 0 is the mirror.
    size
        Texels along one side of level 0; each further level has half as many.
    samples
        Directions a texel of level 1. Each reads a level of the source as wide as what it stands
        for. Further levels, which have ever fewer texels, take twice as many each, up to 4,096.

    Returns
    -------
    CubeChain
        To be read at level roughness (n_levels - 1) with `filter="trilinear"`, and multiplied by
        what `split_sum_table` says. A constant environment gives its constant.

    Raises
    ------
    OptionError
        A number is below 1, or `samples` below 16.
    """
    for name, value, least in (
        ("n_levels", n_levels, 1),
        ("size", size, 1),
        ("samples", samples, 16),
    ):
        if value < least:
            raise OptionError(f"{name}: {value} is too small; it must be at least {least}")
    mirror = resized(cube, size, threads=threads)
    source = cube_chain(mirror, threads=threads)
    levels = [mirror]
    for index in range(1, n_levels):
        n_samples = max(samples, min(samples << (index - 1), _MOST_SAMPLES))
        lobe = _lobe(index / (n_levels - 1), n_samples, source)
        levels.append(_rough(source, lobe, max(size >> index, 1), threads))
    return CubeChain.of(levels)


def hammersley(n_points: int) -> npt.NDArray[np.float64]:
    """Points that fill the unit square evenly, (n, 2): (i + 1/2) / n, and i with its bits reversed.

    Examples
    --------
    >>> hammersley(4).tolist()
    [[0.125, 0.0], [0.375, 0.5], [0.625, 0.25], [0.875, 0.75]]
    """
    index = np.arange(n_points, dtype=np.uint32)
    reverse = np.zeros(n_points)
    for bit in range(32):
        reverse += (index >> np.uint32(bit) & np.uint32(1)) * 0.5 ** (bit + 1)
    return np.stack([(np.arange(n_points) + 0.5) / n_points, reverse], axis=1)


def _lobe(roughness: float, samples: int, source: CubeChain) -> npt.NDArray[np.float64]:
    """Directions in which a rough mirror looks, seen along its normal.

    Returns
    -------
    (n, 5) float64
        x, y, z with the normal along z; the level of the source to read there, a whole number; and
        the weight, which has the cosine in it, after Karis. Only those above the surface.
    """
    points = hammersley(samples)
    alpha2 = roughness**4
    rest = (1 - points[:, 0]) ** _TAIL_POWER
    widened = _TAIL_POWER * (1 - points[:, 0]) ** (_TAIL_POWER - 1)
    turn = 2 * np.pi * points[:, 1]
    cosine2 = rest / (1 + (alpha2 - 1) * (1 - rest))
    sine2 = alpha2 * (1 - rest) / (1 + (alpha2 - 1) * (1 - rest))
    # Mirrored at the half vector: its angle to the normal is doubled.
    sine = 2 * np.sqrt(cosine2 * sine2)
    cosine = cosine2 - sine2
    # Density of the mirrored directions D (n·h) / (4 v·h), where v is the normal.
    density = alpha2 / (4 * np.pi * (cosine2 * (alpha2 - 1) + 1) ** 2) / widened
    per_texel = 4 * np.pi / (6.0 * source.size**2)
    # One more, as the authors advise: samples overlap, and bright lamps leave no pattern of them.
    level = np.floor(0.5 * np.log2(1 / (samples * density) / per_texel) + 1.5)
    level = np.clip(level, 0, source.n_levels - 1)
    lobe = [sine * np.cos(turn), sine * np.sin(turn), cosine, level, cosine * widened]
    return np.ascontiguousarray(np.stack(lobe, axis=1)[cosine > 0])


def _rough(
    source: CubeChain, lobe: npt.NDArray[np.float64], size: int, threads: int | None
) -> CubeMap:
    """Mean over a lobe about each texel's direction."""
    normals = texel_directions(size).reshape(-1, 3)
    out = np.empty((len(normals), source.n_channels), np.float32)

    def work(start: int, stop: int) -> None:
        _rough_kernel(source.texels, source.offsets, source.sizes, lobe, normals, out, start, stop)

    run_bands(work, len(normals), band=_BAND, threads=threads)
    return CubeMap(out.reshape(6, size, size, -1))


@kernel
def _rough_kernel(texels, offsets, sizes, lobe, normals, out, start, stop):  # type: ignore[no-untyped-def]
    n_channels = texels.shape[1]
    sums = np.zeros(n_channels)
    for i in range(start, stop):
        nx = np.float64(normals[i, 0])
        ny = np.float64(normals[i, 1])
        nz = np.float64(normals[i, 2])
        # Two directions that are square to the normal and to each other.
        sign = 1.0 if nz >= 0.0 else -1.0
        a = -1.0 / (sign + nz)
        b = nx * ny * a
        sums[:] = 0.0
        total = 0.0
        for j in range(len(lobe)):
            along, across, up = lobe[j, 0], lobe[j, 1], lobe[j, 2]
            level, weight = int(lobe[j, 3]), lobe[j, 4]
            face, s, t = face_coordinates(
                along * (1.0 + sign * nx * nx * a) + across * b + up * nx,
                along * sign * b + across * (sign + ny * ny * a) + up * ny,
                -along * sign * nx - across * ny + up * nz,
            )
            first, stride, along_x, along_y = cell_of(offsets[level], sizes[level], face, s, t)
            for channel in range(n_channels):
                value = bilinear_in_cell(texels, first, stride, along_x, along_y, channel)
                sums[channel] += weight * value
            total += weight
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / total
