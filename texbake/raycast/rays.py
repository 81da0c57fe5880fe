"""Rays and what they hit, as arrays: row i of `RayHits` is the first hit of row i of `Rays`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray

NO_HIT = -1


@dataclass(frozen=True, eq=False)
class Rows:
    """Base of dataclasses whose fields are arrays of equal length, one row per thing.

    A field may be None, for all rows at once.
    """

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def arrays(self) -> list[Any]:
        """Return the arrays, or None, in the order of the fields."""
        return [getattr(self, field.name) for field in fields(self)]

    def where(self, chosen: npt.NDArray[np.bool_ | np.intp] | slice) -> Self:
        """Return the rows that a mask, indices or a slice select; a slice gives views."""
        return type(self)(*(None if array is None else array[chosen] for array in self.arrays()))

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

    faces: npt.NDArray[np.int32]  # (n,) int32; face that was hit, `NO_HIT` for a miss
    # (n, 2) float64; weights of the second and third corner of that face.
    barycentrics: npt.NDArray[np.float64]
    # (n,) float64; along the ray from its origin, in local units; 0 for a miss.
    distances: npt.NDArray[np.float64]
    passed_back: npt.NDArray[np.bool_]  # whether the ray met a back face before the hit

    @classmethod
    def misses(cls, n: int) -> RayHits:
        """Hits of `n` rays, all of them misses."""
        return cls(
            np.full(n, NO_HIT, dtype=np.int32),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n, dtype=np.bool_),
        )
