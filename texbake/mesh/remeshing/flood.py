"""What is outside of a surface, where a ball of a given radius passes no gap.

The flood runs through points farther from the surface than the radius. What it reaches then grows
back by the radius, so that only gaps too narrow for the ball stay closed. What other floods reach
are rooms: the inside of solid parts, or cavities.

Based on: Jean Serra, "Image Analysis and Mathematical Morphology", Academic Press, 1982 (closing).
Kernels: `core/grid_dilation.c` and `core/grid_flood.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray
from texbake.mesh.remeshing.band import CORE, OUTSIDE, ROOM, SHELL
from texbake.parallel import run_bands

_PLANES = 8

_LEAST_ROOM = 2  # points; of most rooms of a single one, no surface is left


# Of a cavity in a surface that faces outwards the winding number is 0, of a solid room 1.
_LEAST_WINDING = 0.5

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Rooms:
    """Numbers of the rooms that have more than one point."""

    n_cavities: int
    n_untested: int  # those whose winding numbers were not measured, and which count as solid


def flood_outside(
    labels: npt.NDArray[np.uint8],
    radius: float,
    measure_windings: Callable[[FloatArray], FloatArray] | None,
    *,
    keep_cavities: bool = False,
    threads: int | None = None,
) -> Rooms:
    """Label what a ball reaches from the border of the grid `OUTSIDE`.

    `labels` (nx, ny, nz) uint8; `radius`, of the ball beyond the shell, in voxels;
    `measure_windings`: returns winding numbers at points (n, 3), one for each room, the largest
    first, and NaN where it measures none.
    """
    grows = radius >= 1.0  # no two points are closer
    near = np.empty(labels.shape, dtype=np.bool_) if grows else labels == SHELL
    squares = np.empty(labels.shape if grows else 0, dtype=np.uint16)
    if grows:
        _within(labels, SHELL, radius, squares, near, threads)
    core.flood_room(near, labels, 0, OUTSIDE)
    rooms = Rooms(n_cavities=0, n_untested=0)
    if measure_windings is not None:
        rooms = _flood_cavities(near, labels, measure_windings, keep_cavities, threads)
    if not grows:
        return rooms
    _within(labels, OUTSIDE, radius, squares, near, threads)

    def grow(start: int, stop: int) -> None:
        part = labels[start:stop]
        part[near[start:stop] & (part == CORE)] = OUTSIDE

    run_bands(grow, len(labels), band=_PLANES, threads=threads)
    return rooms


def _flood_cavities(
    near: Bools,
    labels: npt.NDArray[np.uint8],
    measure_windings: Callable[[FloatArray], FloatArray],
    keep: bool,
    threads: int | None,
) -> Rooms:
    """Find the cavities, and flood all of them if they are kept."""
    rooms: list[int] = []
    sizes: list[int] = []
    place = 0
    while (place := core.next_room(near, labels, place)) < labels.size:
        sizes.append(core.flood_room(near, labels, place, ROOM))
        rooms.append(place)
    places = np.array(rooms, dtype=np.int64)
    points = np.stack(np.unravel_index(places, labels.shape), axis=1).astype(np.float64)
    n_points = np.array(sizes, dtype=np.int64)
    largest_first = np.argsort(-n_points, kind="stable")
    windings = np.empty(len(points))
    windings[largest_first] = measure_windings(points[largest_first])
    found = np.abs(windings) < _LEAST_WINDING
    if keep:
        for place in places[found].tolist():
            core.flood_room(near, labels, place, OUTSIDE)

    def forget(start: int, stop: int) -> None:
        part = labels[start:stop]
        part[part == ROOM] = CORE

    run_bands(forget, len(labels), band=_PLANES, threads=threads)
    counts = n_points >= _LEAST_ROOM
    return Rooms(
        n_cavities=int(np.count_nonzero(found & counts)),
        n_untested=int(np.count_nonzero(np.isnan(windings) & counts)),
    )


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
