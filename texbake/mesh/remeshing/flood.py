"""What is outside of a surface, where a ball of a given radius passes no gap.

The flood runs through points farther from the surface than the radius. What it reaches then grows
back by the radius, so that only gaps too narrow for the ball stay closed. What other floods reach
are rooms: the inside of solid parts, or cavities.

Based on: Jean Serra, "Image Analysis and Mathematical Morphology", Academic Press, 1982 (closing).
Kernels: `core/grid_dilation.c` and `core/grid_flood.c`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray
from texbake.mesh.remeshing.band import CORE, OUTSIDE, ROOM, SHELL
from texbake.parallel import run_bands

MAX_RADIUS = 180  # squares of distances up to this have 16 bits, and so has the sum of two

_PLANES = 8

_LEAST_ROOM = 2  # points; of most rooms of a single one, no surface is left


Bools = npt.NDArray[np.bool_]


def flood_outside(
    labels: npt.NDArray[np.uint8],
    radius: float,
    is_cavity: Callable[[FloatArray], Bools],
    *,
    keep_cavities: bool = False,
    threads: int | None = None,
) -> int:
    """Label what a ball reaches from the border of the grid `OUTSIDE`.

    Parameters
    ----------
    labels : (nx, ny, nz) uint8
        `SHELL` where no ball may touch, and `CORE`, of which a part becomes `OUTSIDE`.
    radius
        Of the ball beyond the shell, in voxels; the shell is as far from the border at least.
    is_cavity
        Tells of points (n, 3), one in each room that the ball fits into, whether it is a cavity;
        the largest rooms come first.
    keep_cavities
        Label them `OUTSIDE` as well.
    threads
        None for every processor.

    Returns
    -------
    int
        How many cavities of more than a point there are.
    """
    grows = radius >= 1.0  # no two points are closer
    near = np.empty(labels.shape, dtype=np.bool_) if grows else labels == SHELL
    squares = np.empty(labels.shape if grows else 0, dtype=np.uint16)
    if grows:
        _within(labels, SHELL, radius, squares, near, threads)
    core.flood_room(near, labels, 0, OUTSIDE)
    n_cavities = _flood_cavities(near, labels, is_cavity, keep_cavities, threads)
    if not grows:
        return n_cavities
    _within(labels, OUTSIDE, radius, squares, near, threads)

    def grow(start: int, stop: int) -> None:
        part = labels[start:stop]
        part[near[start:stop] & (part == CORE)] = OUTSIDE

    run_bands(grow, len(labels), band=_PLANES, threads=threads)
    return n_cavities


def _flood_cavities(
    near: Bools,
    labels: npt.NDArray[np.uint8],
    is_cavity: Callable[[FloatArray], Bools],
    keep: bool,
    threads: int | None,
) -> int:
    """Count the cavities of more than a point, and flood all of them if they are kept."""
    rooms: list[int] = []
    sizes: list[int] = []
    place = 0
    while (place := core.next_room(near, labels, place)) < labels.size:
        sizes.append(core.flood_room(near, labels, place, ROOM))
        rooms.append(place)
    places = np.array(rooms, dtype=np.int64)
    points = np.stack(np.unravel_index(places, labels.shape), axis=1).astype(np.float64)
    largest_first = np.argsort(-np.array(sizes, dtype=np.int64), kind="stable")
    found = np.empty(len(points), dtype=np.bool_)
    found[largest_first] = is_cavity(points[largest_first])
    cavities = places[found]
    if keep:
        for place in cavities.tolist():
            core.flood_room(near, labels, place, OUTSIDE)

    def forget(start: int, stop: int) -> None:
        part = labels[start:stop]
        part[part == ROOM] = CORE

    run_bands(forget, len(labels), band=_PLANES, threads=threads)
    return int(np.count_nonzero(found & (np.array(sizes, dtype=np.int64) >= _LEAST_ROOM)))


def _within(
    labels: npt.NDArray[np.uint8],
    label: int,
    radius: float,
    squares: npt.NDArray[np.uint16],
    near: Bools,
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
