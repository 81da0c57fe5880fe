"""The peel of an orange: its radius in every direction, as a smooth closed form.

A flattened sphere, made uneven by a few long waves, dented at the stem and at the navel, with pores
of varied size and depth. The pores sit on a Fibonacci lattice, which spaces them evenly without a
pole or a seam, each moved a little by a hash of its number so that no rows are seen.

Based on: Álvaro González, "Measurement of areas on a sphere using Fibonacci and latitude-longitude
lattices", Mathematical Geosciences 42, 2010; Guy L. Steele et al., "Fast splittable pseudorandom
number generators", OOPSLA 2014 (the hash). Kernel: `core/orange_pores.c`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands

_N_CELLS = 48  # a side of the grid that finds the pores near a direction; see `_Pores`
_FLATTENING = 0.93  # height over width
_N_PORES = 8000
_PORE_RADIUS = 0.6  # of the greatest pore, in units of the lattice spacing
_PORE_DEPTH = 0.0065  # of the deepest, in units of the orange's radius
# Wave vector, phase and height of each wave of the unevenness.
_WAVES = (
    ((1.7, 0.6, -1.1), 0.3, 0.012),
    ((-0.9, 2.3, 1.4), 1.9, 0.008),
    ((3.1, -1.2, 2.6), 4.0, 0.005),
    ((-4.3, 3.7, 1.9), 2.2, 0.003),
    ((5.9, 6.1, -5.2), 5.1, 0.0015),
)


def peel_radii(directions: FloatArray) -> FloatArray:
    """Distance from an orange's center to its surface; about 1, the stem up on +Y.

    `directions` (n, 3) float64: unit vectors. Returns (n,) float64.
    """
    pores = _pores()
    radii = np.empty(len(directions))

    def work(start: int, stop: int) -> None:
        part = directions[start:stop]
        radii[start:stop] = _fruit_radii(part) * (1.0 - _pore_depths(part, pores))

    run_bands(work, len(directions), band=65536)
    return radii


def _fruit_radii(directions: FloatArray) -> FloatArray:
    """Radius without the pores."""
    x, y, z = directions.T
    flattened = 1.0 / np.sqrt(x * x + z * z + (y / _FLATTENING) ** 2)
    uneven = sum(
        height * pm.sin(pm.matmul(directions, np.array(wave)) + phase)
        for wave, phase, height in _WAVES
    )
    # Squared distance from the axis; beyond the equator the other end's terms vanish.
    s = x * x + z * z
    top, bottom = (pm.exp(-np.clip(1.0 - sign * y, 0.0, None) / 0.035) for sign in (1.0, -1.0))
    # Re (x + iz)^5 and the like: ribs around the stem that are smooth at the pole itself.
    ribs = (x**5 - 10.0 * x**3 * z**2 + 5.0 * x * z**4) / pm.power(s + 1e-3, 2.5)
    stem = -0.085 * top * (1.0 + 0.22 * ribs * (1.0 - pm.exp(-s / 0.01)))
    button = 0.03 / (1.0 + pm.exp((s - 0.0045) / 0.0009)) * (y > 0.0)
    navel = -0.03 * pm.exp(-np.clip(1.0 + y, 0.0, None) / 0.006) - 0.012 * bottom
    return np.asarray(flattened * (1.0 + uneven + stem + button + navel))


@dataclass(frozen=True)
class _Pores:
    """Pores as balls on the unit sphere, listed by the grid cells that they reach into.

    The grid has `_N_CELLS` cells a side over the cube from -1 to 1; cell c holds the pores
    `cell_pores[cell_starts[c]:cell_starts[c + 1]]`.
    """

    centers: FloatArray
    radii: FloatArray
    depths: FloatArray
    cell_starts: npt.NDArray[np.int64]
    cell_pores: npt.NDArray[np.int64]


@cache
def _pores() -> _Pores:
    i = np.arange(_N_PORES)
    spacing = np.sqrt(4.0 * np.pi / _N_PORES)
    jitter = (0.7 * spacing) * (np.stack([_hashed(i, stream) for stream in range(3)], 1) - 0.5)
    golden_angle = np.pi * (3.0 - math.sqrt(5.0))
    y = 1.0 - (2.0 * i + 1.0) / _N_PORES
    ring = np.sqrt(1.0 - y * y)
    centers = np.stack([ring * pm.cos(golden_angle * i), y, ring * pm.sin(golden_angle * i)], 1)
    centers += jitter
    centers /= pm.norm(centers, axis=1, keepdims=True)
    size = 0.55 + 0.45 * _hashed(i, 3)
    radii = (_PORE_RADIUS * spacing) * size
    depths = _PORE_DEPTH * size * (0.5 + 0.5 * _hashed(i, 4))

    low, high = (_cells(centers + sign * radii[:, None]) for sign in (-1.0, 1.0))
    cells, pores = [], []
    for step in np.ndindex(2, 2, 2):  # no pore is wider than a cell
        reached = low + np.array(step)
        within = (reached <= high).all(axis=1)
        cells.append((reached[within] * [_N_CELLS**2, _N_CELLS, 1]).sum(axis=1))
        pores.append(i[within])
    cell_of = np.concatenate(cells)
    order = np.lexsort([np.concatenate(pores), cell_of])
    starts = np.searchsorted(cell_of[order], np.arange(_N_CELLS**3 + 1))
    return _Pores(centers, radii, depths, starts, np.concatenate(pores)[order])


def _cells(points: FloatArray) -> npt.NDArray[np.int64]:
    cells = np.floor((points + 1.0) * (0.5 * _N_CELLS)).astype(np.int64)
    return np.clip(cells, 0, _N_CELLS - 1)


def _hashed(numbers: npt.NDArray[np.int64], stream: int) -> FloatArray:
    """Evenly spread values in [0, 1), one per number, unrelated between streams (SplitMix64)."""
    z = (numbers.astype(np.uint64) * np.uint64(8) + np.uint64(stream + 1)) * np.uint64(
        0x9E3779B97F4A7C15
    )
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53, dtype=np.float64)


def _pore_depths(directions: FloatArray, pores: _Pores) -> FloatArray:
    """How far the pores sink the peel, in units of its radius."""
    depths = np.empty(len(directions))
    core.pore_depths(
        np.ascontiguousarray(directions, dtype=np.float64),
        pores.centers,
        pores.radii,
        pores.depths,
        _N_CELLS,
        pores.cell_starts,
        pores.cell_pores,
        depths,
    )
    return depths
