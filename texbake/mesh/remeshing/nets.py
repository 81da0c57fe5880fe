"""The surface between outside and the solid, as a closed and manifold mesh.

Kernels: `core/shell_signs.c`, `core/well_composed.c`, `core/surface_nets.c` and
`core/folded_faces.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.remeshing.band import BLOCK_POINTS, SHELL_DEPTH, Band
from texbake.mesh.topology import face_components
from texbake.parallel import run_bands

_SLOTS, _LAYERS, _QUADS = 256, 8, 1 << 16

JUST_SOLID = -0.05
"""Field of a point that is added to a solid, as in `core/well_composed.c`."""


@dataclass(frozen=True, eq=False)
class Nets:
    """A surface of quads."""

    positions: FloatArray  # (V, 3) float64; in units of a voxel, each in a cell of its own
    thin: npt.NDArray[np.bool_]  # (V,) bool; vertices around a sheet without thickness
    quads: IntArray  # (n, 4) int32; counter-clockwise seen from outside

    @property
    def n_handles(self) -> int:
        """Handles of a closed surface, which has two edges for each quad."""
        halves = np.concatenate([self.quads[:, :3], self.quads[:, 1:]])
        n_parts = face_components(halves, len(self.positions))[1]
        return n_parts - (len(self.positions) - len(self.quads)) // 2

    def triangles(self, positions: FloatArray, *, threads: int | None = None) -> IntArray:
        """Divide the quads evenly at the positions that vertices have moved to.

        Where a face would then be folded, the quad is divided as it would have been before.

        Returns (2 n, 3) int32.
        """
        faces = np.empty((len(self.quads), 2, 3), dtype=np.int32)

        def work(start: int, stop: int) -> None:
            core.split_quads(self.positions, positions, self.quads, faces, start, stop)

        run_bands(work, len(self.quads), band=_QUADS, threads=threads)
        return faces.reshape(-1, 3)


def build_nets(band: Band, labels: npt.NDArray[np.uint8], *, threads: int | None = None) -> Nets:
    """Build the surface around all that is not labeled `OUTSIDE`.

    `labels` (nx, ny, nz) uint8.
    """
    field, thin = signed(band, labels, threads)
    return nets_of(band, field, labels, thin, threads=threads)


def nets_of(
    band: Band,
    field: npt.NDArray[np.float32],
    labels: npt.NDArray[np.uint8],
    thin: npt.NDArray[np.bool_],
    *,
    threads: int | None = None,
) -> Nets:
    """Build the surface around the points where a field of the band is not positive.

    `field` (n_slots, 512) float32; `labels` (nx, ny, nz) uint8; `thin` (n_slots, 512) bool.
    """
    return nets_around(band, field, solid_points(band, field, labels, threads), thin, threads)


def solid_points(
    band: Band, field: npt.NDArray[np.float32], labels: npt.NDArray[np.uint8], threads: int | None
) -> npt.NDArray[np.bool_]:
    """Whether each point of the grid is solid, (nx, ny, nz), as in `nets_of`."""
    solid = np.empty(labels.shape, dtype=np.bool_)

    def mark(start: int, stop: int) -> None:
        core.mark_solid(band.slots, field, labels, solid, start, stop)

    run_bands(mark, len(solid), band=_LAYERS, threads=threads)
    return solid


def nets_around(
    band: Band,
    field: npt.NDArray[np.float32],
    solid: npt.NDArray[np.bool_],
    thin: npt.NDArray[np.bool_],
    threads: int | None,
) -> Nets:
    """Build the surface around solid points, which are filled up to make it manifold."""
    core.compose_well(band.slots, solid, field)
    n_vertices, n_quads = (np.zeros(len(solid), dtype=np.int64) for _ in range(2))

    def count(start: int, stop: int) -> None:
        core.count_nets(solid, n_vertices, n_quads, start, stop)

    run_bands(count, len(solid), band=_LAYERS, threads=threads)
    vertex_starts, quad_starts = (
        np.concatenate([[0], np.cumsum(counts)]) for counts in (n_vertices, n_quads)
    )
    positions = np.empty((vertex_starts[-1], 3))
    is_thin = np.empty(vertex_starts[-1], dtype=np.bool_)
    quads = np.empty((quad_starts[-1], 4), dtype=np.int32)
    surface = (vertex_starts, quad_starts, positions, is_thin, quads)

    def build(start: int, stop: int) -> None:
        core.build_nets(band.slots, field, thin, solid, *surface, start, stop)

    run_bands(build, len(solid), band=_LAYERS, threads=threads)
    return Nets(positions, is_thin, quads)


def signed(
    band: Band, labels: npt.NDArray[np.uint8], threads: int | None
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Signed distances at the points of the band, and which of them belong to a sheet."""
    n = len(band.distances)
    seen = np.empty((n, BLOCK_POINTS), dtype=np.uint8)
    field = np.empty((n, BLOCK_POINTS), dtype=np.float32)
    thin = np.empty((n, BLOCK_POINTS), dtype=np.bool_)
    given = (band.slots, band.corners, band.distances, labels)

    def see(start: int, stop: int) -> None:
        core.see_shell(*given, seen, start, stop)

    def sign(start: int, stop: int) -> None:
        core.sign_shell(*given, seen, field, thin, SHELL_DEPTH, start, stop)

    for work in (see, sign):
        run_bands(work, n, band=_SLOTS, threads=threads)
    return field, thin
