"""A checker of unit squares or unit cubes, 1 and 0 by turns.

The cell that holds (1/2, 1/2, 1/2) is 1. With s = ±1 by turns along each axis the checker is
1/2 + 1/2 s(x) s(y) s(z), and its mean over a box is that with the means of s over the box's sides,
which is exact.
"""

from __future__ import annotations

from typing import Any

from texbake.kernels import kernel
from texbake.texture.procedures.pulses import HARD, box_mean
from texbake.texture.procedures.samples import Samples, Work, coordinates, width_along


@kernel
def _checker_kernel(points, widths, n_dimensions, out, start, stop):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        place = coordinates(points, i)
        sign = 1.0
        for axis in range(n_dimensions):
            # A coordinate that points do not have is 0 all over the pixel.
            span = width_along(widths, i, axis) if axis < points.shape[1] else 0.0
            sign *= 2.0 * box_mean(HARD, 0.5, 0.5 * place[axis], 0.5 * span) - 1.0
        out[i, 0] = 0.5 + 0.5 * sign


def checker(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Squares over x and y, or cubes; None: as many dimensions as the points have."""
    n_dimensions = parameters["dimensions"] or samples.n_dimensions

    def work(start: int, stop: int) -> None:
        _checker_kernel(samples.points, samples.widths, n_dimensions, samples.out, start, stop)

    return work
