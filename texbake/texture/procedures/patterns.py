"""Checkers, stripes, solid stone and wood, and legends, as functions of a point.

docs/reference/procedures.md has the formulas. A checker is 1/2 + 1/2 s(x) s(y) s(z) with s = ±1 by
turns along each axis, and its mean over a box is that with the means of s over the box's sides. In
marble, octaves of the turbulence that fade inside the sine shift its phase at random, and the mean
of sin(phase + d) over a normally distributed d of variance s^2 is exp(-s^2 / 2) sin(phase). Granite
takes a nearly normally distributed sum of variance v to an even distribution over 0 to 1 by the
logistic curve 1 / (1 + exp(-1.702 s / sqrt(v))); where octaves fade, their variance is added to v.

A legend is 0 at `start`, 1 at `end` and linear between them; `wrap` says what comes beyond. In a
wide pixel it is the mean over the pixel, from the antiderivative of the wrapped value, which is
exact for a gradient. Kernel, which names the sources: `core/patterns.c`.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.records import dataclass
from texbake.texture.procedures.noise import WEIGHTS, gradients, lattice, squared_amplitudes
from texbake.texture.procedures.options import DEFAULT_RAMPS
from texbake.texture.procedures.points import ProcedurePoints, Work, unit_vector

# Number of values for the mean color; ramps have only a few stops.
_N_VALUES = 1 << 12


@dataclass(frozen=True, eq=False)
class Ramp:
    """Color ramp of a procedure."""

    # (k, 3) float64; linear RGB at evenly spaced values from 0 to 1. Read-only.
    stops: FloatArray
    # (3,) float64; mean color over the distribution of the procedure's values. Read-only.
    mean: FloatArray


@lru_cache(maxsize=16)
def own_ramp(name: str, distribution: str) -> Ramp:
    """Return the ramp of a procedure with values distributed `even` in [0, 1] or as a `sine`."""
    stops = np.array(DEFAULT_RAMPS[name])
    t = (np.arange(_N_VALUES) + 0.5) / _N_VALUES
    values = t if distribution == "even" else 0.5 + 0.5 * pm.sin(2.0 * np.pi * t)
    places = np.linspace(0.0, 1.0, len(stops))
    mean = np.array([pm.interp(values, places, channel).mean() for channel in stops.T])
    stops.flags.writeable = False
    mean.flags.writeable = False
    return Ramp(stops, mean)


# As in `core/patterns.c`.
HARD, SINE, RAMP = range(3)


def checker(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Squares in x and y, or cubes; with None, the points determine the number of dimensions."""
    n_dimensions = parameters["dimensions"] or samples.n_dimensions
    return partial(core.fill_checker, samples.points, samples.widths, samples.out, n_dimensions)


def stripes(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Stripes of value 1 that begin at the origin and cover `width` of each period."""
    direction = unit_vector(parameters["direction"])
    pattern = {"hard": HARD, "sine": SINE}[parameters["profile"]]
    width = parameters["width"]
    return partial(
        core.fill_stripes, samples.points, samples.widths, direction, samples.out, pattern, width
    )


def marble(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """White stone with dark veins across `direction`; see the module for the formula."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    mean = weight.size[samples.n_dimensions - 2]
    numbers = (
        *(parameters[key] for key in ("frequency", "turbulence_frequency", "amount")),
        *(parameters[key] for key in ("lacunarity", "gain")),
        mean,
        weight.variance[samples.n_dimensions - 2] - mean * mean,
    )
    ramp = own_ramp("marble", "sine")
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    direction, octaves = unit_vector(parameters["direction"]), parameters["octaves"]
    return partial(
        core.fill_marble, samples.points, samples.widths, permutation, slopes, direction,
        ramp.stops, ramp.mean, samples.out, weight.quintic, octaves, *numbers,
    )  # fmt: skip


def wood(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Rings about `axis`; see the module for the formula."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    numbers = (*(parameters[key] for key in ("rings", "wobble", "grain")), weight.bound)
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    axis = unit_vector(parameters["axis"])
    ramp = own_ramp("wood", "even")
    return partial(
        core.fill_wood, samples.points, samples.widths, permutation, slopes, axis, ramp.stops,
        ramp.mean, samples.out, weight.quintic, *numbers,
    )  # fmt: skip


def granite(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Grains of dark mica, gray quartz, red and white feldspar; see the module for the formula."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    octaves = parameters["octaves"]
    squares = squared_amplitudes(octaves, parameters["gain"])
    variance = weight.variance[samples.n_dimensions - 2]
    numbers = (
        *(parameters[key] for key in ("frequency", "lacunarity", "gain")), squares, variance
    )  # fmt: skip
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    ramp = own_ramp("granite", "even")
    return partial(
        core.fill_granite, samples.points, samples.widths, permutation, slopes, ramp.stops,
        ramp.mean, samples.out, weight.quintic, octaves, *numbers,
    )  # fmt: skip


# Shares of the legend; a narrower pixel shows the value at its point.
_NARROW = 1e-4


def gradient(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Position along `direction`, from `start` to `end`."""
    direction = unit_vector(parameters["direction"])[: samples.n_dimensions]

    def work(start: int, stop: int) -> None:
        points = _finite(samples.points[start:stop])
        widths = pm.matmul(_widths(samples, start, stop), np.abs(direction))
        samples.out[start:stop, 0] = legend_values(pm.matmul(points, direction), widths, parameters)

    return work


def radial(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Distance from `center`, from `start` to `end`."""
    center = np.array(parameters["center"])[: samples.n_dimensions]

    def work(start: int, stop: int) -> None:
        away = _finite(samples.points[start:stop]) - center
        lengths = pm.norm(away, axis=1)
        units = away / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        widths = pm.vecdot(np.abs(units), _widths(samples, start, stop))
        samples.out[start:stop, 0] = legend_values(lengths, widths, parameters)

    return work


def legend_values(
    positions: FloatArray, widths: FloatArray, parameters: dict[str, Any]
) -> FloatArray:
    """(n,) mean value of a legend over intervals of these widths around positions."""
    start, end, wrap = (parameters[key] for key in ("start", "end", "wrap"))
    at, widths = (positions - start) / (end - start), np.abs(widths / (end - start))
    if wrap == "clamp":
        at = np.clip(at, -1.0 - widths, 2.0 + widths)
    else:
        period = 1.0 if wrap == "repeat" else 2.0
        at = at - period * np.floor(at / period)
    wide = np.maximum(widths, _NARROW)
    means = (_integral(at + 0.5 * wide, wrap) - _integral(at - 0.5 * wide, wrap)) / wide
    return np.clip(np.where(widths > _NARROW, means, _wrapped(at, wrap)), 0.0, 1.0)


def _wrapped(at: FloatArray, wrap: str) -> FloatArray:
    if wrap == "clamp":
        return np.clip(at, 0.0, 1.0)
    return at - np.floor(at) if wrap == "repeat" else 1.0 - np.abs(1.0 - at % 2.0)


def _integral(at: FloatArray, wrap: str) -> FloatArray:
    """Integral of the wrapped value from 0."""
    if wrap == "clamp":
        return 0.5 * np.clip(at, 0.0, 1.0) ** 2 + np.maximum(at - 1.0, 0.0)
    if wrap == "repeat":
        whole = np.floor(at)
        return 0.5 * whole + 0.5 * (at - whole) ** 2
    whole = np.floor(0.5 * at)
    rest = at - 2.0 * whole
    return whole + np.where(rest <= 1.0, 0.5 * rest**2, 1.0 - 0.5 * (2.0 - rest) ** 2)


def _finite(points: FloatArray) -> FloatArray:
    """Points as the other procedures take them: what is no number, or too far away, counts as 0."""
    return np.where(np.abs(points) <= 2.0**50, points, 0.0)


def _widths(samples: ProcedurePoints, start: int, stop: int) -> FloatArray:
    """(n, D) widths of the pixels along each axis; 0 for a point."""
    shape = (min(stop, len(samples.points)) - start, samples.n_dimensions)
    if samples.widths is None:
        return np.zeros(shape)
    widths = np.broadcast_to(samples.widths[start:stop], shape).astype(np.float64)
    return np.where((widths > 0.0) & (widths < 2.0**50), widths, 0.0)
