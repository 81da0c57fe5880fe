"""Marble: layers of stone, bent by turbulence.

The value is 1/2 + 1/2 sin(k1 x + a turbulence(k2 p)), with x the distance along a direction. Veins
are where it is 0. In a wide pixel the layers fade with the mean of a sine over the pixel; octaves
of the turbulence that fade inside the sine shift its phase at random, and the mean of
sin(phase + d) over a normally distributed d of variance s^2 is exp(-s^2 / 2) sin(phase).

Based on: Perlin, "An Image Synthesizer", 1985. Departs from it in the factor a before the
turbulence, without which (a = 1) veins are hardly bent.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.texture.procedures.directions import unit_vector
from texbake.texture.procedures.gradient_noise import WEIGHTS, gradients
from texbake.texture.procedures.lattice import lattice
from texbake.texture.procedures.octaves import octave_sum
from texbake.texture.procedures.ramps import own_ramp, show
from texbake.texture.procedures.samples import Samples, Work, coordinates, span_along, widest


@kernel
def _marble_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, numbers, direction, stops, mean_color,
    out, start, stop,
):  # fmt: skip
    k1, k2, amount, lacunarity, gain, mean, variance = numbers
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        total, lost = octave_sum(
            permutation, slopes, quintic, octaves, (lacunarity, gain), mean, x * k2, y * k2, z * k2,
            widest(widths, i) * k2,
        )  # fmt: skip
        along = direction[0] * x + direction[1] * y + direction[2] * z
        layer = np.sin(k1 * along + amount * total)
        kept = np.exp(-0.5 * amount * amount * variance * lost)
        half = 0.5 * k1 * span_along(widths, i, direction)
        if half > 0.0:
            # Beyond one whole period the mean of a sine swings about 0; there it stays 0.
            kept *= np.sin(half) / half if half < np.pi else 0.0
        show(out, i, 0.5 + 0.5 * kept * layer, 0.5 + 0.5 * layer, kept, stops, mean_color)


def marble(samples: Samples, parameters: dict[str, Any]) -> Work:
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
        _marble_kernel(
            samples.points, samples.widths, permutation, slopes, weight.quintic, octaves, numbers,
            direction, ramp.stops, ramp.mean, samples.out, start, stop,
        )  # fmt: skip

    return work
