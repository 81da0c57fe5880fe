"""Checkers, stripes and solid stone and wood, as functions of a point.

Checker: the cell that holds (1/2, 1/2, 1/2) is 1, and cells alternate with 0. With s = ±1 by turns
along each axis the checker is 1/2 + 1/2 s(x) s(y) s(z), and its mean over a box is that with the
means of s over the box's sides, which is exact. Stripes have the period 1 across a direction.

Marble, layers of stone bent by turbulence: the value is
1/2 + 1/2 sin(k1 x + a turbulence(k2 p)), with x the distance along a direction. Veins are where it
is 0. In a wide pixel the layers fade with the mean of a sine over the pixel; octaves of the
turbulence that fade inside the sine shift its phase at random, and the mean of sin(phase + d) over
a normally distributed d of variance s^2 is exp(-s^2 / 2) sin(phase).

Wood, the uneven rings of a trunk with fibers along it: with r the distance from the axis through
the origin, the phase is n r + b noise(q), for n rings per unit. Over each ring the value goes
slowly from light to dark and quickly back (a `RAMP` of width 0.8), averaged over the pixel; fibers
are noise stretched along the axis and mixed in.

Granite, grains of a few minerals from a rough fractal sum: the sum s, nearly normally distributed
with a known variance v, is taken to an even distribution over 0 to 1 by the logistic curve
1 / (1 + exp(-1.702 s / sqrt(v))), so that each stop of a ramp covers as much of the stone as any
other. Where octaves fade, the mean of the curve over what is missing is the same curve with their
variance added to v.

Based on: Perlin, "An Image Synthesizer", 1985 (marble, and rings bent by noise); Ebert et al.,
"Texturing and Modeling: A Procedural Approach", 3rd edition, 2003 (rings and grain); Upstill, "The
RenderMan Companion", 1990 (granite from octaves of noise); Haley, "Estimation of the Dosage
Mortality Relationship When the Dose Is Subject to Error", 1952 (1.702). Departs from Perlin in the
factor a before the turbulence, without which (a = 1) veins are hardly bent. Kernels:
`core/pulse_train.c` and `core/solid_patterns.c`.
"""

from __future__ import annotations

from typing import Any

from texbake.core import core
from texbake.texture.procedures.noise import WEIGHTS, gradients, lattice, squared_amplitudes
from texbake.texture.procedures.points import ProcedurePoints, Work, unit_vector
from texbake.texture.procedures.ramps import own_ramp

# As in `core/pulse_train.h`.
HARD, SINE, RAMP = range(3)


def checker(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Squares in x and y, or cubes; with None, the points determine the number of dimensions."""
    n_dimensions = parameters["dimensions"] or samples.n_dimensions

    def work(start: int, stop: int) -> None:
        core.fill_checker(samples.points, samples.widths, samples.out, n_dimensions, start, stop)

    return work


def stripes(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Stripes of value 1 that begin at the origin and cover `width` of each period."""
    direction = unit_vector(parameters["direction"])
    pattern = {"hard": HARD, "sine": SINE}[parameters["profile"]]
    width = parameters["width"]

    def work(start: int, stop: int) -> None:
        core.fill_stripes(
            samples.points, samples.widths, direction, samples.out, pattern, width, start, stop
        )

    return work


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

    def work(start: int, stop: int) -> None:
        core.fill_marble(
            samples.points, samples.widths, permutation, slopes, direction, ramp.stops, ramp.mean,
            samples.out, weight.quintic, octaves, *numbers, start, stop,
        )  # fmt: skip

    return work


def wood(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Rings about `axis`; see the module for the formula."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    numbers = (*(parameters[key] for key in ("rings", "wobble", "grain")), weight.bound)
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    axis = unit_vector(parameters["axis"])
    ramp = own_ramp("wood", "even")

    def work(start: int, stop: int) -> None:
        core.fill_wood(
            samples.points, samples.widths, permutation, slopes, axis, ramp.stops, ramp.mean,
            samples.out, weight.quintic, *numbers, start, stop,
        )  # fmt: skip

    return work


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

    def work(start: int, stop: int) -> None:
        core.fill_granite(
            samples.points, samples.widths, permutation, slopes, ramp.stops, ramp.mean,
            samples.out, weight.quintic, octaves, *numbers, start, stop,
        )  # fmt: skip

    return work
