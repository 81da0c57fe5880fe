"""Cells about scattered points: the distance to the nearest, or how much farther the second is.

Each cell of the lattice holds one point, anywhere in it (`jitter` 1) or in its middle (0). F1 is
the distance to the nearest of all points, F2 to the second nearest; F2 - F1 is 0 on the borders
between their regions. Cells are searched in rings about the own one until no cell further out can
hold a nearer point, so that both are exact.

Based on: Worley, "A Cellular Texture Basis Function", 1996. Departs from it in having one point a
cell, which leaves no large gaps.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.texture.procedures.lattice import PERIOD, cell, lattice
from texbake.texture.procedures.samples import Samples, Work, coordinates, kept_of, widest

F1 = 0
F2_MINUS_F1 = 1
_FEATURES = {"f1": F1, "f2-f1": F2_MINUS_F1}

# Points that the mean of a pattern is measured at, in its first period: good to 0.3 %.
_N_MEASURED = 1 << 14


@kernel
def _nearest_two(permutation, places, jitter, n_dimensions, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distances to the nearest and the second nearest point."""
    i, u = cell(x)
    j, v = cell(y)
    k, t = cell(z)
    nearest = np.inf
    second = np.inf
    reach = 0
    while True:
        reach_z = reach if n_dimensions == 3 else 0
        for dk in range(-reach_z, reach_z + 1):
            gap_k = _gap(t, dk) if n_dimensions == 3 else 0.0
            hash_k = permutation[(k + dk) & 255] if n_dimensions == 3 else 0
            for dj in range(-reach, reach + 1):
                gap_jk = gap_k + _gap(v, dj)
                # Inside the ring all cells have been searched before.
                inside = max(abs(dj), abs(dk)) < reach
                hash_j = permutation[((j + dj) & 255) + hash_k]
                for di in range(-reach, reach + 1, 2 * reach if inside else 1):
                    if gap_jk + _gap(u, di) >= second:
                        continue
                    index = permutation[((i + di) & 255) + hash_j]
                    off_x = di + 0.5 + jitter * (places[index, 0] - 0.5) - u
                    off_y = dj + 0.5 + jitter * (places[index, 1] - 0.5) - v
                    squared = off_x * off_x + off_y * off_y
                    if n_dimensions == 3:
                        off_z = dk + 0.5 + jitter * (places[index, 2] - 0.5) - t
                        squared += off_z * off_z
                    second = min(second, max(nearest, squared))
                    nearest = min(nearest, squared)
        if second <= reach * reach:  # what lies further out is at least that far away
            return nearest, second
        reach += 1


@kernel
def _gap(within, step):  # type: ignore[no-untyped-def]
    """Square of how far the cell `step` cells away is along one axis."""
    if step == 0:
        return 0.0
    gap = step - within if step > 0 else within - step - 1.0
    return gap * gap


@kernel
def _worley_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, places, jitter, n_dimensions, feature, mean, out, start, stop
):
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        kept = kept_of(widest(widths, i))
        value = 0.0
        if kept > 0.0:
            nearest, second = _nearest_two(permutation, places, jitter, n_dimensions, x, y, z)
            value = np.sqrt(nearest)
            if feature == F2_MINUS_F1:
                value = np.sqrt(second) - value
        out[i, 0] = mean + kept * (min(value, 1.0) - mean)


def worley(samples: Samples, parameters: dict[str, Any]) -> Work:
    """F1 or F2 - F1 in cell widths, clamped to 1; None: as many dimensions as the points have."""
    n_dimensions = parameters["dimensions"] or samples.n_dimensions
    feature, jitter, seed = (parameters[key] for key in ("feature", "jitter", "seed"))
    mean = _mean(feature, jitter, n_dimensions, seed) if len(samples.widths) else 0.0
    tables = lattice(seed)

    def work(start: int, stop: int) -> None:
        _worley_kernel(
            samples.points, samples.widths, tables.permutation, tables.places, jitter,
            n_dimensions, _FEATURES[feature], mean, samples.out, start, stop,
        )  # fmt: skip

    return work


@lru_cache(maxsize=64)
def _mean(feature: str, jitter: float, n_dimensions: int, seed: int) -> float:
    """Mean value of a pattern, which wide pixels show."""
    # Multiples of the plastic number's powers modulo 1: points that cover space evenly.
    steps = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
    points = np.arange(_N_MEASURED)[:, None] * steps % 1.0 * PERIOD
    points = points[:, :n_dimensions].copy()
    points.flags.writeable = False
    widths = np.empty((0, 1), np.float32)
    widths.flags.writeable = False
    out = np.empty((_N_MEASURED, 1), np.float32)
    parameters = {"feature": feature, "jitter": jitter, "dimensions": n_dimensions, "seed": seed}
    worley(Samples(points, widths, out), parameters)(0, _N_MEASURED)
    return float(out.mean(dtype=np.float64))
