"""What is outside of a surface, where a ball of a given radius passes no gap.

The flood runs through points farther from the surface than the radius. What it reaches then grows
back by the radius, so that only gaps too narrow for the ball stay closed.

Based on: Jean Serra, "Image Analysis and Mathematical Morphology", Academic Press, 1982 (closing).
Kernels: `core/grid_dilation.c` and `core/grid_flood.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.remeshing.band import CORE, OUTSIDE, SHELL
from texbake.parallel import run_bands

MAX_RADIUS = 180  # squares of distances up to this have 16 bits, and so has the sum of two

_PLANES = 8


def flood_outside(
    labels: npt.NDArray[np.uint8], radius: float, *, threads: int | None = None
) -> None:
    """Label what a ball reaches from the border of the grid `OUTSIDE`.

    Parameters
    ----------
    labels : (nx, ny, nz) uint8
        `SHELL` where no ball may touch, and `CORE`, of which a part becomes `OUTSIDE`.
    radius
        Of the ball beyond the shell, in voxels; the shell is as far from the border at least.
    """
    if radius < 1.0:  # no two points are closer
        core.flood_outside(labels == SHELL, labels)
        return
    squares = np.empty(labels.shape, dtype=np.uint16)
    near = np.empty(labels.shape, dtype=np.bool_)
    _within(labels, SHELL, radius, squares, near, threads)
    core.flood_outside(near, labels)
    _within(labels, OUTSIDE, radius, squares, near, threads)

    def grow(start: int, stop: int) -> None:
        part = labels[start:stop]
        part[near[start:stop] & (part == CORE)] = OUTSIDE

    run_bands(grow, len(labels), band=_PLANES, threads=threads)


def _within(
    labels: npt.NDArray[np.uint8],
    label: int,
    radius: float,
    squares: npt.NDArray[np.uint16],
    near: npt.NDArray[np.bool_],
    threads: int | None,
) -> None:
    """Find the points within a radius of those with a label."""
    whole = int(radius)

    def measure(start: int, stop: int) -> None:
        core.measure_planes(labels, squares, label, whole, start, stop)

    def reach(start: int, stop: int) -> None:
        core.reach_planes(squares, near, whole, int(radius * radius), start, stop)

    for work in (measure, reach):
        run_bands(work, len(labels), band=_PLANES, threads=threads)
