"""Noise: gradient and value noise, sums over octaves, and cells about scattered points.

docs/reference/procedures.md has the formulas and their sources. Everything random comes from the
hash of integer lattice points, phi(i + phi(j + phi(k))) modulo 256, with a permutation phi of 0 to
255 from a generator of 64-bit integers defined here, so that a seed means the same forever. Cells
of Worley are searched in rings until none further out can hold a nearer point, so that both
distances are exact. Kernel: `core/noise.c`.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import ByteArray, FloatArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.procedures.options import INTERPOLATIONS, checked_parameters
from texbake.texture.procedures.points import (
    BAND,
    ProcedurePoints,
    Work,
    checked_points,
    checked_widths,
)

PERIOD = 256
_MASK = (1 << 64) - 1


@dataclass(frozen=True, eq=False)
class Lattice:
    """Tables for a seed, read-only."""

    # (512,) uint8; phi, repeated twice, so that a sum of two numbers below 256 can be looked up.
    permutation: ByteArray
    # (256, 3) float64; unit vectors, uniform over the sphere: the gradients of 1985.
    sphere: FloatArray
    # (256, 3) float64; vectors from the center of a cube to the middles of its edges: the gradients
    # of 2002.
    edges: FloatArray
    places: FloatArray  # (256, 3) float64; points, uniform in the unit cube


@lru_cache(maxsize=64)
def lattice(seed: int) -> Lattice:
    """Return the tables for a seed, any whole number; only its value modulo 2^64 matters."""
    random = _SplitMix64(seed)
    permutation = list(range(PERIOD))
    for last in range(PERIOD - 1, 0, -1):  # Fisher and Yates
        other = random.below(last + 1)
        permutation[last], permutation[other] = permutation[other], permutation[last]
    directions = [vector for vector in product((-1, 0, 1), repeat=3) if vector.count(0) == 1]
    # 16 vectors, as in 2002: four of the 12, the corners of a tetrahedron, occur twice.
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
    """A random generator of 64-bit integers in plain Python, the same on every platform."""

    def __init__(self, seed: int) -> None:
        self._state = seed & _MASK

    def _next(self) -> int:
        self._state = (self._state + 0x9E3779B97F4A7C15) & _MASK
        mixed = self._state
        mixed = ((mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & _MASK
        return mixed ^ (mixed >> 31)

    def below(self, bound: int) -> int:
        """Return a whole number from 0 to bound - 1, uniform to within 2^-56."""
        return (self._next() * bound) >> 64

    def unit(self) -> float:
        """Return a multiple of 2^-53 in [0, 1)."""
        return (self._next() >> 11) * 2.0**-53

    def direction(self) -> tuple[float, float, float]:
        """Return a unit vector, from a point in the unit ball."""
        while True:
            x, y, z = (2.0 * self.unit() - 1.0 for _ in "xyz")
            squared = x * x + y * y + z * z
            if 1e-4 < squared <= 1.0:
                length = np.sqrt(squared)
                return x / length, y / length, z / length


@dataclass(frozen=True)
class Weight:
    """Statistics of noise with one of the two weights, over space and seeds 0 to 31."""

    quintic: bool
    bound: float  # upper bound on |noise|
    # Mean of noise^2, with two coordinates and with three.
    variance: tuple[float, float]
    size: tuple[float, float]  # mean of |noise|, likewise


WEIGHTS = {
    "cubic": Weight(False, 0.8660254037844387, (0.02987, 0.03329), (0.1376, 0.1477)),
    "quintic": Weight(True, 1.0363538112, (0.0638, 0.0729), (0.2045, 0.2200)),
}


def gradients(weight: str, seed: int) -> FloatArray:
    """Return the gradients for a weight and a seed, (256, 3) float64, read-only."""
    tables = lattice(seed)
    return tables.edges if WEIGHTS[weight].quintic else tables.sphere


def noise(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Return 1/2 + noise(p) / (2 bound), so that 0 to 1 holds all of it; its mean is 1/2."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    return partial(
        core.fill_noise, samples.points, samples.widths, permutation, slopes, samples.out,
        weight.quintic, weight.bound,
    )  # fmt: skip


def value_noise(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Return random numbers of lattice points, interpolated; their mean is about 1/2."""
    tables = lattice(parameters["seed"])
    numbers = np.ascontiguousarray(tables.places[:, 0])
    interpolation = INTERPOLATIONS.index(parameters["interpolation"])
    return partial(
        core.fill_value_noise, samples.points, samples.widths, tables.permutation, numbers,
        samples.out, interpolation,
    )  # fmt: skip


def squared_amplitudes(octaves: int, gain: float) -> float:
    """Return the sum of the squared amplitudes of octaves."""
    return sum(pm.power(gain, 2 * i) for i in range(octaves))


def fractal_sum(
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None = None,
    *,
    threads: int | None = None,
    **parameters: Any,
) -> FloatArray:
    """Return the signed sum (n,) of g^i noise(l^i p + i c) on unit cells, of mean 0; see `fractal`.

    >>> bool(abs(fractal_sum([[3.0, -7.0, 1e9]], octaves=1)[0]) == 0.0)
    True
    """
    full = checked_parameters("fractal", parameters)
    rows = checked_points(points)
    widths = checked_widths(footprint, rows)
    tables, numbers = _tables(full, rows.shape[1], absolute=False)
    sums = np.empty(len(rows))
    work = partial(core.fill_octave_sums, rows, widths, *tables, sums, *numbers)
    run_bands(work, len(rows), band=BAND, threads=threads)
    return sums


def _tables(
    parameters: dict[str, Any], n_dimensions: int, absolute: bool
) -> tuple[tuple[Any, Any], tuple[bool, int, float, float, float]]:
    """Return the tables and the numbers of a sum, as the kernels take them."""
    weight, seed = WEIGHTS[parameters["weight"]], parameters["seed"]
    return (lattice(seed).permutation, gradients(parameters["weight"], seed)), (
        weight.quintic,
        parameters["octaves"],
        parameters["lacunarity"],
        parameters["gain"],
        weight.size[n_dimensions - 2] if absolute else -1.0,
    )


def fractal(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Return 1/2 + fractal(p) / (2 bound a), clamped to [0, 1]; a^2 is the sum of g^2i."""
    return _as_values(samples, parameters, absolute=False)


def turbulence(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Return turbulence(p) / (bound a), clamped to [0, 1]; a^2 is the sum of g^2i."""
    return _as_values(samples, parameters, absolute=True)


def _as_values(samples: ProcedurePoints, parameters: dict[str, Any], *, absolute: bool) -> Work:
    tables, numbers = _tables(parameters, samples.n_dimensions, absolute)
    squares = squared_amplitudes(parameters["octaves"], parameters["gain"])
    scale = 1.0 / (WEIGHTS[parameters["weight"]].bound * np.sqrt(squares))
    offset, scale = (0.0, scale) if absolute else (0.5, 0.5 * scale)
    return partial(
        core.fill_octave_values, samples.points, samples.widths, *tables, samples.out, *numbers,
        offset, scale,
    )  # fmt: skip


# As in `core/noise.c`.
_FEATURE_CODES = {"f1": 0, "f2-f1": 1}

# Number of points, in the first period, for the mean of a pattern; accurate to 0.3 %.
_N_MEASURED = 1 << 14


def worley(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Return F1 or F2 - F1 in cell widths, clamped to 1, in `dimensions` or those of the points."""
    n_dimensions = parameters["dimensions"] or samples.n_dimensions
    feature, jitter, seed = (parameters[key] for key in ("feature", "jitter", "seed"))
    mean = _worley_mean(feature, jitter, n_dimensions, seed) if samples.widths is not None else 0.0
    tables = lattice(seed)
    return partial(
        core.fill_cells, samples.points, samples.widths, tables.permutation, tables.places,
        samples.out, jitter, n_dimensions == 3, _FEATURE_CODES[feature], mean,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _worley_mean(feature: str, jitter: float, n_dimensions: int, seed: int) -> float:
    """Return the mean value of a pattern, which wide pixels show."""
    # Multiples of the powers of the plastic number modulo 1 cover space evenly.
    steps = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
    points = np.arange(_N_MEASURED)[:, None] * steps % 1.0 * PERIOD
    points = points[:, :n_dimensions].copy()
    out = np.empty((_N_MEASURED, 1), np.float32)
    parameters = {"feature": feature, "jitter": jitter, "dimensions": n_dimensions, "seed": seed}
    worley(ProcedurePoints(points, None, out), parameters)(0, _N_MEASURED)
    return float(out.mean(dtype=np.float64))
