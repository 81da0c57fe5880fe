"""Directions over a hemisphere: sets of them, each evenly spread by itself, unlike the others.

Each set is a scrambled net: of its n points in the unit square exactly one lies in every cell of a
grid of n cells, whatever the set. The points are sorted by those cells, so that the j-th directions
of all sets are about the same, and rays in packets of the j-th direction of neighboring samples
stay together. The scrambling of different sets is independent, so what is left of the error is
noise without a pattern from sample to sample, and its mean is the truth.

Based on: Owen, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences", 1995, for the scrambling;
Burley, "Practical Hash-based Owen Scrambling", Journal of Computer Graphics Techniques 9(4), 2020,
for its permutation by a hash; Sobol', "On the Distribution of Points in a Cube", 1967, its first
two dimensions; Shirley, Chiu, "A Low Distortion Map Between Disk and Square", 1997; Malley's method
(points of a disk raised to the hemisphere are spread by the cosine).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import frozen

UintArray = npt.NDArray[np.uint32]

# Directions of all sets together: 3/4 MB, which stays in a processor's second cache.
_DIRECTIONS = 1 << 16
_BITS = 32


@lru_cache(maxsize=2)
def direction_sets(n_rays: int) -> npt.NDArray[np.float32]:
    """Sets of unit vectors about +z, their density proportional to the cosine to it.

    Parameters
    ----------
    n_rays : int
        A power of two, at most 65,536.

    Returns
    -------
    (S, n_rays, 3) float32
        S is a power of two. The mean over a set of any function of the direction estimates its
        mean over the hemisphere, weighted by the cosine.

    Examples
    --------
    >>> direction_sets(64).shape
    (1024, 64, 3)
    """
    points = _sorted(scrambled_nets(_DIRECTIONS // n_rays, n_rays))
    disk = concentric_disk((points.astype(np.float64) + 0.5) / 2.0**_BITS)
    z = np.sqrt(1.0 - np.square(disk).sum(axis=-1, keepdims=True))
    return frozen(np.concatenate([disk, z], axis=-1).astype(np.float32))


def scrambled_nets(n_sets: int, n_points: int) -> UintArray:
    """Owen-scrambled copies of the first points of Sobol's sequence in two dimensions.

    Returns
    -------
    (n_sets, n_points, 2) uint32
        Coordinates in the unit square times 2^32.
    """
    ids = np.arange(n_points, dtype=np.uint32)
    # The first coordinate mirrors the bits of the index at the point; scrambling wants its bits
    # mirrored once more, so that it begins with the index itself.
    mirrored = np.stack([ids, _mirrored(_second_sobol(ids))], axis=-1)
    seeds = mixed(np.arange(2 * n_sets, dtype=np.uint32)).reshape(n_sets, 1, 2)
    return _mirrored(_permuted(mirrored[np.newaxis], seeds))


def concentric_disk(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Points of the unit square, (..., 2) in (0, 1), on the unit disk; areas keep their ratios."""
    x, y = np.moveaxis(2.0 * points - 1.0, -1, 0)
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.where(wide, y / x, x / y)
    slope[radius == 0.0] = 0.0
    angle = 0.25 * np.pi * slope
    cosine, sine = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([np.where(wide, cosine, sine), np.where(wide, sine, cosine)], axis=-1)


def mixed(values: UintArray) -> UintArray:
    """A hash of each number: every bit of it changes with every bit of the number.

    Based on: Appleby, MurmurHash3, 2011, its final steps.
    """
    values = (values ^ (values >> np.uint32(16))) * np.uint32(0x85EBCA6B)
    values = (values ^ (values >> np.uint32(13))) * np.uint32(0xC2B2AE35)
    return np.asarray(values ^ (values >> np.uint32(16)))


def _second_sobol(ids: UintArray) -> UintArray:
    """Coordinates times 2^32 in Sobol's second dimension, whose polynomial is x + 1."""
    values = np.zeros_like(ids)
    direction = np.uint32(1 << (_BITS - 1))
    for bit in range(_BITS):
        values ^= np.where((ids >> np.uint32(bit)) & np.uint32(1), direction, np.uint32(0))
        direction ^= direction >> np.uint32(1)
    return values


def _permuted(mirrored: UintArray, seeds: UintArray) -> UintArray:
    """Flip each bit by a hash of the seed and of the bits below it (Burley 2020, section 2)."""
    values = mirrored + seeds
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        values = values ^ values * np.uint32(factor)
    return np.asarray(values)


def _mirrored(values: UintArray) -> UintArray:
    """The bits of each number in the opposite order."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF)):
        step, kept = np.uint32(shift), np.uint32(mask)
        values = ((values >> step) & kept) | ((values & kept) << step)
    return np.asarray((values >> np.uint32(16)) | (values << np.uint32(16)))


def _sorted(nets: UintArray) -> UintArray:
    """Each net's points in the order of the cells of one grid, of which each has one point."""
    bits = nets.shape[1].bit_length() - 1
    columns, rows = (bits + 1) // 2, bits // 2
    cells = _top_bits(nets[..., 0], columns) << np.uint32(rows) | _top_bits(nets[..., 1], rows)
    order = np.argsort(cells, axis=1)
    return np.take_along_axis(nets, order[:, :, np.newaxis], axis=1)


def _top_bits(values: UintArray, n: int) -> UintArray:
    """The first n bits of each number; 0 where n is 0."""
    return (values >> np.uint32(_BITS - n)) if n else np.zeros_like(values)
