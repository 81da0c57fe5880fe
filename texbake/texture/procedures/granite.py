"""Granite: grains of a few minerals, from a rough fractal sum.

The fractal sum s, nearly normally distributed with a variance v that is known, is taken to an even
distribution over 0 to 1 by the logistic curve 1 / (1 + exp(-1.702 s / sqrt(v))), so that each stop
of a ramp covers as much of the stone as any other. Where octaves fade, the mean of the curve over
what is missing is the same curve with their variance added to v.

Based on: Upstill, "The RenderMan Companion", 1990 (granite from octaves of noise); Haley,
"Estimation of the Dosage Mortality Relationship When the Dose Is Subject to Error", 1952 (1.702).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.texture.procedures.gradient_noise import WEIGHTS, gradients
from texbake.texture.procedures.lattice import lattice
from texbake.texture.procedures.octaves import octave_sum, squared_amplitudes
from texbake.texture.procedures.ramps import own_ramp, show
from texbake.texture.procedures.samples import Samples, Work, coordinates, widest


@kernel
def _granite_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, octaves, numbers, stops, mean_color,
    out, start, stop,
):  # fmt: skip
    frequency, lacunarity, gain, squares, variance = numbers
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        total, lost = octave_sum(
            permutation, slopes, quintic, octaves, (lacunarity, gain), -1.0,
            frequency * x, frequency * y, frequency * z, frequency * widest(widths, i),
        )  # fmt: skip
        kept = np.sqrt(max(squares - lost, 0.0) / squares)
        value = _evened(total, variance * (squares + lost))
        # What is left of the sum, with the distribution that all of it would have.
        sharp = _evened(total, variance * (squares - lost)) if kept > 0.0 else 0.5
        show(out, i, value, sharp, kept, stops, mean_color)


@kernel
def _evened(total, variance):  # type: ignore[no-untyped-def]
    return 1.0 / (1.0 + np.exp(-1.702 * total / np.sqrt(variance)))


def granite(samples: Samples, parameters: dict[str, Any]) -> Work:
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
        _granite_kernel(
            samples.points, samples.widths, permutation, slopes, weight.quintic, octaves, numbers,
            ramp.stops, ramp.mean, samples.out, start, stop,
        )  # fmt: skip

    return work
