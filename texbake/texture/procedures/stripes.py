"""Stripes of period 1 across a direction, with hard edges or blended by a sine."""

from __future__ import annotations

from typing import Any

from texbake.kernels import kernel
from texbake.texture.procedures.directions import unit_vector
from texbake.texture.procedures.pulses import HARD, SINE, box_mean
from texbake.texture.procedures.samples import Samples, Work, coordinates, span_along


@kernel
def _stripes_kernel(points, widths, pattern, width, direction, out, start, stop):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        x, y, z = coordinates(points, i)
        along = direction[0] * x + direction[1] * y + direction[2] * z
        out[i, 0] = box_mean(pattern, width, along, span_along(widths, i, direction))


def stripes(samples: Samples, parameters: dict[str, Any]) -> Work:
    """Stripes of 1 begin at the origin and take `width` of a period; see `pulses`."""
    direction = unit_vector(parameters["direction"])
    pattern = {"hard": HARD, "sine": SINE}[parameters["profile"]]
    width = parameters["width"]

    def work(start: int, stop: int) -> None:
        _stripes_kernel(
            samples.points, samples.widths, pattern, width, direction, samples.out, start, stop
        )

    return work
