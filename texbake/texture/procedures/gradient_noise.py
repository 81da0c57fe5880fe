"""Gradient noise: 0 at every lattice point, with a random slope there, smooth in between.

At the point p the noise is the sum over the eight corners (i, j, k) of its cell of

    w(u) w(v) w(t) (G(phi(i + phi(j + phi(k)))) . (u, v, t)),   (u, v, t) = p - (i, j, k)

with the weight w(t) = 2|t|^3 - 3|t|^2 + 1 and unit gradients G even over the sphere (cubic, C1), or
w(t) = 1 - |t|^3 (6|t|^2 - 15|t| + 10) and gradients toward the edges of a cube (quintic, C2).

`noise_at` can be called from the kernels of other modules.

Based on: Perlin, "An Image Synthesizer", 1985; Perlin, "Improving Noise", 2002. Departs from the
latter in the order of the hash, which is that of 1985 for both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.texture.procedures.lattice import cell, lattice
from texbake.texture.procedures.samples import Samples, Work, coordinates, kept_of, widest

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Weight:
    """What is known of noise with one of the two weights.

    The bound is reached where all eight gradients point to the middle of their cell; for edges of
    a cube it is the greatest value that a search over all points and gradients found, rounded up.
    The others are means over space, with three coordinates or in the plane z = 0, and over seeds 0
    to 31; one seed lies within some 2 % of them, in the plane within 5 %. The variance of the cubic
    form has a closed form, from which these are taken.

    Attributes
    ----------
    quintic : bool
    bound : float
        No noise is larger.
    variance : (float, float)
        Mean of noise^2; with two coordinates and with three.
    size : (float, float)
        Mean of |noise|.
    """

    quintic: bool
    bound: float
    variance: tuple[float, float]
    size: tuple[float, float]


WEIGHTS = {
    "cubic": Weight(False, 0.8660254037844387, (0.02987, 0.03329), (0.1376, 0.1477)),
    "quintic": Weight(True, 1.0363538112, (0.0638, 0.0729), (0.2045, 0.2200)),
}


def gradients(weight: str, seed: int) -> FloatArray:
    """(256, 3) float64, read-only: the gradients that belong to a weight."""
    tables = lattice(seed)
    return tables.edges if WEIGHTS[weight].quintic else tables.sphere


@kernel
def noise_at(permutation, gradients, quintic, x, y, z):  # type: ignore[no-untyped-def]
    """Signed noise at a point with finite coordinates."""
    i, u = cell(x)
    j, v = cell(y)
    k, t = cell(z)
    # w(t - 1) = 1 - w(t), so that the sum over corners is one interpolation after another.
    to_right, to_back, to_top = _risen(u, quintic), _risen(v, quintic), _risen(t, quintic)
    right, back, top = (i + 1) & 255, j + 1, k + 1
    below, above = permutation[k], permutation[top]
    front_below, back_below = permutation[j + below], permutation[(back & 255) + below]
    front_above, back_above = permutation[j + above], permutation[(back & 255) + above]
    low = _along_edge(
        permutation, gradients, i + front_below, right + front_below, to_right, u, v, t
    )
    far = _along_edge(
        permutation, gradients, i + back_below, right + back_below, to_right, u, v - 1.0, t
    )
    low += to_back * (far - low)
    t -= 1.0
    high = _along_edge(
        permutation, gradients, i + front_above, right + front_above, to_right, u, v, t
    )
    far = _along_edge(
        permutation, gradients, i + back_above, right + back_above, to_right, u, v - 1.0, t
    )
    high += to_back * (far - high)
    return low + to_top * (high - low)


@kernel
def _along_edge(permutation, gradients, left, right, to_right, u, v, t):  # type: ignore[no-untyped-def]
    """Slopes of the two corners of an edge along x, interpolated."""
    left, right = permutation[left], permutation[right]
    at_left = gradients[left, 0] * u + gradients[left, 1] * v + gradients[left, 2] * t
    at_right = gradients[right, 0] * (u - 1.0) + gradients[right, 1] * v + gradients[right, 2] * t
    return at_left + to_right * (at_right - at_left)


@kernel
def _risen(t, quintic):  # type: ignore[no-untyped-def]
    """Return 1 - w(t) for t in [0, 1]."""
    if quintic:
        return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    return t * t * (3.0 - 2.0 * t)


@kernel
def _noise_kernel(points, widths, permutation, slopes, quintic, bound, out, start, stop):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        kept = kept_of(widest(widths, i))
        value = 0.0
        if kept > 0.0:
            value = kept * noise_at(permutation, slopes, quintic, x, y, z)
        out[i, 0] = 0.5 + 0.5 * value / bound


def noise(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Return 1/2 + noise(p) / (2 bound), so that 0 to 1 holds all of it; its mean is 1/2."""
    name, seed = parameters["weight"], parameters["seed"]
    weight = WEIGHTS[name]
    permutation, slopes = lattice(seed).permutation, gradients(name, seed)

    def work(start: int, stop: int) -> None:
        _noise_kernel(
            samples.points, samples.widths, permutation, slopes, weight.quintic, weight.bound,
            samples.out, start, stop,
        )  # fmt: skip

    return work
