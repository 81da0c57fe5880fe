"""The solid, which a ball of a given radius does not reach from outside, and its surface.

The flood runs through points farther from the surface of the mesh than the radius. What it reaches
then grows back by the radius, so that only gaps too narrow for the ball stay closed. What other
floods reach are rooms: the inside of solid parts, or cavities. The surface between outside and the
solid is a closed and manifold mesh of quads.

Based on: Jean Serra, "Image Analysis and Mathematical Morphology", Academic Press, 1982 (closing).
Kernels: `core/grid_flood.c`, `core/narrow_band.c`, `core/surface_nets.c` and `core/folded_faces.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from texbake.mesh.remeshing.band import BLOCK_POINTS, CORE, OUTSIDE, ROOM, SHELL, SHELL_DEPTH, Band
from texbake.mesh.topology import face_components
from texbake.parallel import run_bands
from texbake.records import dataclass

_LEAST_ROOM = 2  # points; of most rooms of a single one, no surface is left


# Of a cavity in a surface that faces outwards the winding number is 0, of a solid room 1.
_LEAST_WINDING = 0.5


@dataclass(frozen=True, kw_only=True)
class Rooms:
    """Numbers of the rooms that have more than one point."""

    n_cavities: int
    n_untested: int  # those whose winding numbers were not measured, and which count as solid


def flood_outside(
    labels: ByteArray,
    radius: float,
    measure_windings: Callable[[FloatArray], FloatArray] | None,
    *,
    keep_cavities: bool = False,
    threads: int | None = None,
) -> Rooms:
    """Label what a ball of `radius` voxels reaches from the border `OUTSIDE`, by windings."""
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

    run_bands(grow, len(labels), band=_LAYERS, threads=threads)
    return rooms


def _flood_cavities(
    near: BoolArray,
    labels: ByteArray,
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

    run_bands(forget, len(labels), band=_LAYERS, threads=threads)
    counts = n_points >= _LEAST_ROOM
    return Rooms(
        n_cavities=int(np.count_nonzero(found & counts)),
        n_untested=int(np.count_nonzero(np.isnan(windings) & counts)),
    )


def _within(
    labels: ByteArray,
    label: int,
    radius: float,
    squares: npt.NDArray[np.uint16],
    near: BoolArray,
    threads: int | None,
) -> None:
    """Find the points within a radius of those with a label."""
    whole = int(radius)

    measure = partial(core.measure_planes, labels, squares, label, whole)
    reach = partial(core.reach_planes, squares, near, whole, int(radius * radius))
    for work in (measure, reach):
        run_bands(work, len(labels), band=_LAYERS, threads=threads)


_SLOTS, _LAYERS, _QUADS = 256, 8, 1 << 16

JUST_SOLID = -0.05
"""Float32Array of a point that is added to a solid, as in `core/surface_nets.c`."""


@dataclass(frozen=True, eq=False)
class Nets:
    """A surface of quads."""

    positions: FloatArray  # (V, 3) float64; in units of a voxel, each in a cell of its own
    thin: BoolArray  # (V,) bool; vertices around a sheet without thickness
    quads: IntArray  # (n, 4) int32; counter-clockwise seen from outside

    @property
    def n_handles(self) -> int:
        """Handles of a closed surface, which has two edges for each quad."""
        halves = np.concatenate([self.quads[:, :3], self.quads[:, 1:]])
        n_parts = face_components(halves, len(self.positions))[1]
        return n_parts - (len(self.positions) - len(self.quads)) // 2

    def triangles(self, positions: FloatArray, *, threads: int | None = None) -> IntArray:
        """(2 n, 3) divided quads at new positions, evenly, or as before where that would fold."""
        faces = np.empty((len(self.quads), 2, 3), dtype=np.int32)
        split = partial(core.split_quads, self.positions, positions, self.quads, faces)
        run_bands(split, len(self.quads), band=_QUADS, threads=threads)
        return faces.reshape(-1, 3)


def nets_of(
    band: Band,
    field: Float32Array,
    labels: ByteArray,
    thin: BoolArray,
    *,
    threads: int | None = None,
) -> Nets:
    """Build the surface around points (n_slots, 512) where a field is not positive."""
    return nets_around(band, field, solid_points(band, field, labels, threads), thin, threads)


def solid_points(
    band: Band, field: Float32Array, labels: ByteArray, threads: int | None
) -> BoolArray:
    """Whether each point of the grid is solid, (nx, ny, nz), as in `nets_of`."""
    solid = np.empty(labels.shape, dtype=np.bool_)
    mark = partial(core.mark_solid, band.slots, field, labels, solid)
    run_bands(mark, len(solid), band=_LAYERS, threads=threads)
    return solid


def nets_around(
    band: Band, field: Float32Array, solid: BoolArray, thin: BoolArray, threads: int | None
) -> Nets:
    """Build the surface around solid points, which are filled up to make it manifold."""
    core.compose_well(band.slots, solid, field)
    n_vertices, n_quads = (np.zeros(len(solid), dtype=np.int64) for _ in range(2))
    count = partial(core.count_nets, solid, n_vertices, n_quads)
    run_bands(count, len(solid), band=_LAYERS, threads=threads)
    vertex_starts, quad_starts = (
        np.concatenate([[0], np.cumsum(counts)]) for counts in (n_vertices, n_quads)
    )
    positions = np.empty((vertex_starts[-1], 3))
    is_thin = np.empty(vertex_starts[-1], dtype=np.bool_)
    quads = np.empty((quad_starts[-1], 4), dtype=np.int32)
    surface = (vertex_starts, quad_starts, positions, is_thin, quads)
    build = partial(core.build_nets, band.slots, field, thin, solid, *surface)
    run_bands(build, len(solid), band=_LAYERS, threads=threads)
    return Nets(positions, is_thin, quads)


def signed(band: Band, labels: ByteArray, threads: int | None) -> tuple[Float32Array, BoolArray]:
    """Signed distances at the points of the band, and which of them belong to a sheet."""
    n = len(band.distances)
    seen = np.empty((n, BLOCK_POINTS), dtype=np.uint8)
    field = np.empty((n, BLOCK_POINTS), dtype=np.float32)
    thin = np.empty((n, BLOCK_POINTS), dtype=np.bool_)
    shell = (band.slots, band.corners, band.distances, labels)
    run_bands(partial(core.see_shell, *shell, seen), n, band=_SLOTS, threads=threads)
    sign = partial(core.sign_shell, *shell, seen, field, thin, SHELL_DEPTH)
    run_bands(sign, n, band=_SLOTS, threads=threads)
    return field, thin
