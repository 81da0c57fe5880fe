"""The hash of integer lattice points that noise and cells are made of, from a seed.

phi is a permutation of 0 to 255, and the hash of the lattice point (i, j, k) is
phi(i + phi(j + phi(k))) modulo 256, so that a pattern repeats after 256 cells. Everything random
comes from a generator of 64-bit integers defined here, so that a seed means the same forever.

`cell` and `bounded` can be called from the kernels of other modules.

Based on: Perlin, "An Image Synthesizer", 1985 (the hash and the random gradients); Perlin,
"Improving Noise", 2002 (the gradients toward the edges of a cube); Steele, Lea and Flood, "Fast
Splittable Pseudorandom Number Generators", 2014 (SplitMix64).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel

PERIOD = 256

# Neighbors of this magnitude in float64 are 2^-2 apart: what lies further out has no place within
# a cell any more. Times every frequency that can be asked for it stays finite.
_FARTHEST = 2.0**50

_MASK = (1 << 64) - 1


@dataclass(frozen=True, eq=False)
class Lattice:
    """Tables of a seed, read-only.

    Attributes
    ----------
    permutation : (512,) uint8
        phi, twice over, so that a sum of two numbers below 256 can be looked up. Of bytes the
        compiler knows that no index is negative, which saves a fifth of the time of noise.
    sphere : (256, 3) float64
        Unit vectors, even over the sphere: the gradients of 1985.
    edges : (256, 3) float64
        Vectors from the center of a cube to the middles of its edges: the gradients of 2002.
    places : (256, 3) float64
        Points, even in the unit cube.
    """

    permutation: npt.NDArray[np.uint8]
    sphere: npt.NDArray[np.float64]
    edges: npt.NDArray[np.float64]
    places: npt.NDArray[np.float64]


@lru_cache(maxsize=64)
def lattice(seed: int) -> Lattice:
    """Tables of a seed; any whole number, those that differ by a multiple of 2^64 are the same."""
    random = _SplitMix64(seed)
    permutation = list(range(PERIOD))
    for last in range(PERIOD - 1, 0, -1):  # Fisher and Yates
        other = random.below(last + 1)
        permutation[last], permutation[other] = permutation[other], permutation[last]
    directions = [vector for vector in product((-1, 0, 1), repeat=3) if vector.count(0) == 1]
    # Of 16 a few more than once, as 2002 has it: the corners of a tetrahedron.
    directions += [(1, 1, 0), (-1, 1, 0), (0, -1, 1), (0, -1, -1)]
    tables = Lattice(
        permutation=np.array(permutation * 2, np.uint8),
        sphere=np.array([random.direction() for _ in range(PERIOD)]),
        edges=np.array([directions[i % 16] for i in range(PERIOD)], np.float64),
        places=np.array([[random.unit() for _ in "xyz"] for _ in range(PERIOD)]),
    )
    for table in (tables.permutation, tables.sphere, tables.edges, tables.places):
        table.flags.writeable = False
    return tables


class _SplitMix64:
    """A generator of 64-bit integers in whole numbers of Python, the same everywhere."""

    def __init__(self, seed: int) -> None:
        self._state = seed & _MASK

    def _next(self) -> int:
        self._state = (self._state + 0x9E3779B97F4A7C15) & _MASK
        mixed = self._state
        mixed = ((mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & _MASK
        return mixed ^ (mixed >> 31)

    def below(self, bound: int) -> int:
        """Whole number from 0 to bound - 1; uneven by less than 2^-56."""
        return (self._next() * bound) >> 64

    def unit(self) -> float:
        """Multiple of 2^-53 in [0, 1)."""
        return (self._next() >> 11) * 2.0**-53

    def direction(self) -> tuple[float, float, float]:
        """Unit vector: a point within the unit ball, moved outwards."""
        while True:
            x, y, z = (2.0 * self.unit() - 1.0 for _ in "xyz")
            squared = x * x + y * y + z * z
            if 1e-4 < squared <= 1.0:
                length = squared**0.5
                return x / length, y / length, z / length


@kernel
def bounded(coordinate):  # type: ignore[no-untyped-def]
    """Return the coordinate, or 0 where it is not finite or too far out to lie within a cell."""
    # False also for what is not a number.
    return coordinate if abs(coordinate) <= _FARTHEST else 0.0


@kernel
def cell(coordinate):  # type: ignore[no-untyped-def]
    """Index of the cell modulo 256, and how far into the cell the coordinate lies, in [0, 1).

    For any finite coordinate: the remainder is taken before it becomes an integer.
    """
    floor = np.floor(coordinate)
    return int(floor - PERIOD * np.floor(floor / PERIOD)) & 255, coordinate - floor
