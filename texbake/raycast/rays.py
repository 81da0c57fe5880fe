"""Rays and what they hit, as arrays: row i of `RayHits` is the first hit of row i of `Rays`.

Hemispheres of rays measure how open the surroundings of a surface are, and how thick it is. From a
point of the surface, the outer rays spread over the hemisphere of the shading normal, and the inner
rays go the opposite way. Directions that would point below the plane of the face are mirrored at
it, so that no ray enters the face it starts on, and a convex surface is fully open however few
faces it has.

These columns sum up the rays of a hemisphere:

- `OPEN`: the share of the outer rays that hit nothing, 0 to 1;
- `OPEN_DIRECTION`: the mean of their directions, not normalized; the axis of the hemisphere where
  all outer rays hit something;
- `DEPTH`: the mean distance that the inner rays go.

A column whose rays are not cast holds NaN.
"""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IndexArray, IntArray, frozen
from texbake.records import dataclass

NO_HIT = -1


@dataclass(frozen=True, eq=False)
class Rows:
    """Base of dataclasses of arrays with one row per thing, or None for all rows at once."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def arrays(self) -> list[Any]:
        """Return the arrays, or None, in the order of the fields."""
        return [getattr(self, field.name) for field in fields(self)]

    def where(self, chosen: npt.NDArray[np.bool_ | np.intp] | slice) -> Self:
        """Return the rows that a mask, indices or a slice select; a slice gives views."""
        return type(self)(*(None if array is None else array[chosen] for array in self.arrays()))

    def take(self, others: Self, rows: IndexArray) -> None:
        """Replace rows by those of others, in place."""
        for column, other in zip(self.arrays(), others.arrays(), strict=True):
            if column is not None:
                column[rows] = other

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Concatenate the rows of several values of the same class, in their order."""
        columns = zip(*(part.arrays() for part in parts), strict=True)
        return cls(*(None if column[0] is None else np.concatenate(column) for column in columns))


@dataclass(frozen=True, eq=False)
class Rays(Rows):
    """Rays in the local frame."""

    # origins, directions: (n, 3) float64; directions are unit vectors, or zero where there is no
    # direction: such a ray has length 0 and hits nothing.
    origins: FloatArray
    directions: FloatArray
    lengths: FloatArray  # (n,) float64; how far each ray goes
    # (n,) float64; distance along the ray at which it crosses the low-poly surface; the casting
    # ignores it.
    fronts: FloatArray


@dataclass(frozen=True, eq=False)
class RayHits(Rows):
    """The first hit of each ray, in the order of the rays."""

    faces: IntArray  # (n,) int32; face that was hit, `NO_HIT` for a miss
    # (n, 2) float64; weights of the second and third corner of that face.
    barycentrics: FloatArray
    # (n,) float64; along the ray from its origin, in local units; 0 for a miss.
    distances: FloatArray
    passed_back: BoolArray  # whether the ray met a back face before the hit

    @classmethod
    def misses(cls, n: int) -> RayHits:
        """Hits of `n` rays, all of them misses."""
        return cls(
            np.full(n, NO_HIT, dtype=np.int32),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n, dtype=np.bool_),
        )


OPEN = 0
OPEN_DIRECTION = slice(1, 4)
DEPTH = 4
N_COLUMNS = 5

UintArray = npt.NDArray[np.uint32]

# Directions of all sets together: 3/4 MB, which fits into the second-level cache of a processor.
_DIRECTIONS = 1 << 16
_BITS = 32


@dataclass(frozen=True, eq=False)
class Hemispheres(Rows):
    """Hemispheres of rays in the local frame, each around one point."""

    points: FloatArray  # (n, 3) float64; on the surface
    # (n, 3) float32; unit shading normals; zero where there is none, and then the hemisphere hits
    # nothing.
    axes: Float32Array
    # (n, 3) float32; unit normals of the faces, on the side of the axis; the axis where a face has
    # no area.
    planes: Float32Array
    # (n,) uint32; hashes that select a set of directions for each hemisphere.
    set_ids: npt.NDArray[np.uint32]


class OcclusionRange(NamedTuple):
    """How far the rays of hemispheres go, in local units."""

    offset: float  # rays start this far above or below the surface
    # outer, inner: length of the outer rays, which may be infinite, and of the inner rays; 0: none
    # are cast.
    outer: float
    inner: float


@lru_cache(maxsize=4)
def direction_sets(n_rays: int, n_parts: int = 1, n_directions: int = _DIRECTIONS) -> Float32Array:
    """(S, n_rays, 3) sets of unit vectors about +z, by the cosine; each `n_parts` sets are one net.

    Based on: Owen, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences", 1995; Burley, "Practical
    Hash-based Owen Scrambling", Journal of Computer Graphics Techniques 9(4), 2020, for its
    permutation by a hash; Sobol', "On the Distribution of Points in a Cube", 1967, its first two
    dimensions; Shirley, Chiu, "A Low Distortion Map Between Disk and Square", 1997; Malley's
    method.
    """
    n_points = n_rays * n_parts
    # Points of a net that follow each other, in number a power of two, are a net themselves.
    points = _sorted(scrambled_nets(n_directions // n_points, n_points).reshape(-1, n_rays, 2))
    disk = concentric_disk((points.astype(np.float64) + 0.5) / 2**_BITS)
    z = np.sqrt(1.0 - np.square(disk).sum(axis=-1, keepdims=True))
    return frozen(np.concatenate([disk, z], axis=-1).astype(np.float32))


def scrambled_nets(n_sets: int, n_points: int) -> UintArray:
    """(n_sets, n_points, 2) uint32: Owen-scrambled first points of Sobol's sequence, times 2^32."""
    ids = np.arange(n_points, dtype=np.uint32)
    # The first coordinate is the index with its bits reversed. Scrambling works on reversed bits,
    # so this begins with the index itself.
    mirrored = np.stack([ids, _mirrored(_second_sobol(ids))], axis=-1)
    seeds = mixed(np.arange(2 * n_sets, dtype=np.uint32)).reshape(n_sets, 1, 2)
    return _mirrored(_permuted(mirrored[np.newaxis], seeds))


def concentric_disk(points: FloatArray) -> FloatArray:
    """Map points of the unit square, (..., 2) in (0, 1), to the unit disk, preserving areas."""
    x, y = np.moveaxis(2.0 * points - 1.0, -1, 0)
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.where(wide, y / x, x / y)
    slope[radius == 0.0] = 0.0
    angle = 0.25 * np.pi * slope
    cosine, sine = radius * pm.cos(angle), radius * pm.sin(angle)
    return np.stack([np.where(wide, cosine, sine), np.where(wide, sine, cosine)], axis=-1)


def mixed(values: UintArray) -> UintArray:
    """Hash of each number, each bit of which depends on all, after Appleby, MurmurHash3, 2011."""
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
    """Reverse the bits of each number."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF)):
        step, kept = np.uint32(shift), np.uint32(mask)
        values = ((values >> step) & kept) | ((values & kept) << step)
    return np.asarray((values >> np.uint32(16)) | (values << np.uint32(16)))


def _sorted(nets: UintArray) -> UintArray:
    """Sort the points of each net by the cells of a grid that has one point in every cell."""
    bits = nets.shape[1].bit_length() - 1
    columns, rows = (bits + 1) // 2, bits // 2
    cells = _top_bits(nets[..., 0], columns) << np.uint32(rows) | _top_bits(nets[..., 1], rows)
    order = np.argsort(cells, axis=1, kind="stable")
    return np.take_along_axis(nets, order[:, :, np.newaxis], axis=1)


def _top_bits(values: UintArray, n: int) -> UintArray:
    """The first n bits of each number; 0 where n is 0."""
    return (values >> np.uint32(_BITS - n)) if n else np.zeros_like(values)
