"""Wood: the rings of a trunk about an axis, uneven, with fibers along it.

With r the distance from the axis through the origin, the phase is n r + b noise(q), n rings a unit.
Over each ring the value goes slowly from light to dark and quickly back (a `RAMP` of width 0.8),
averaged over the pixel; fibers are noise drawn out along the axis and mixed in.

Based on: Perlin, "An Image Synthesizer", 1985 (rings bent by noise); Ebert et al., "Texturing and
Modeling: A Procedural Approach", 3rd edition, 2003 (rings and grain).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.texture.procedures.directions import unit_vector
from texbake.texture.procedures.gradient_noise import WEIGHTS, gradients, noise_at
from texbake.texture.procedures.lattice import lattice
from texbake.texture.procedures.pulses import RAMP, box_mean
from texbake.texture.procedures.ramps import own_ramp, show
from texbake.texture.procedures.samples import Samples, Work, coordinates, kept_of, widest

# Share of a ring that grows darker.
_RISE = 0.8
# Cells of noise a ring, across the axis and along it: rings bend over several of their widths and
# hardly along the trunk; fibers are thin and long.
_BEND_CELLS = (0.2, 0.05)
_FIBER_CELLS = (5.0, 0.12)


@kernel
def _drawn_noise(permutation, slopes, quintic, across, along, axis, cells, width):  # type: ignore[no-untyped-def]
    """Noise with so many cells a ring across and along the axis, faded by the pixel's width."""
    kept = kept_of(width * cells[0])
    if kept == 0.0:
        return 0.0
    return kept * noise_at(
        permutation, slopes, quintic,
        cells[0] * across[0] + cells[1] * along * axis[0],
        cells[0] * across[1] + cells[1] * along * axis[1],
        cells[0] * across[2] + cells[1] * along * axis[2],
    )  # fmt: skip


@kernel
def _wood_kernel(  # type: ignore[no-untyped-def]
    points, widths, permutation, slopes, quintic, numbers, axis, stops, mean_color, out, start, stop
):
    rings, wobble, grain, bound = numbers
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        x, y, z = rings * x, rings * y, rings * z  # one ring is one unit from here on
        width = rings * widest(widths, i)
        along = axis[0] * x + axis[1] * y + axis[2] * z
        across = (x - along * axis[0], y - along * axis[1], z - along * axis[2])
        radius = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
        bend = _drawn_noise(permutation, slopes, quintic, across, along, axis, _BEND_CELLS, width)
        fiber = _drawn_noise(permutation, slopes, quintic, across, along, axis, _FIBER_CELLS, width)
        ring = box_mean(RAMP, _RISE, radius + wobble * bend, width)
        value = (1.0 - grain) * ring + grain * (0.5 + 0.5 * fiber / bound)
        show(out, i, value, value, kept_of(0.5 * width), stops, mean_color)


def wood(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Rings about `axis`; see the module for the formula."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    numbers = (*(parameters[key] for key in ("rings", "wobble", "grain")), weight.bound)
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)
    axis = unit_vector(parameters["axis"])
    ramp = own_ramp("wood", "even")

    def work(start: int, stop: int) -> None:
        _wood_kernel(
            samples.points, samples.widths, permutation, slopes, weight.quintic, numbers, axis,
            ramp.stops, ramp.mean, samples.out, start, stop,
        )  # fmt: skip

    return work
