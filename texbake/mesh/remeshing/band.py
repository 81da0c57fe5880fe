"""A grid of voxels around a mesh, with exact distances at the points near its surface.

Kernel: `core/narrow_band.c`.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.distance import face_areas
from texbake.mesh.frame import LocalFrame, snapped
from texbake.mesh.mesh import (
    BoolArray,
    ByteArray,
    Float32Array,
    FloatArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.options import MIN_RESOLUTION, RemeshOptions
from texbake.mesh.weld import later_copies
from texbake.parallel import run_bands
from texbake.records import dataclass

# As in `core/voxel_grid.h`.
BLOCK_SIDE, BLOCK_POINTS = 8, 512
CORE, SHELL, OUTSIDE, ROOM = 0, 1, 2, 3

MAX_RADIUS = 180  # squares of distances up to this have 16 bits, and so has the sum of two
# Distances are measured this far, in voxels: more than `SHELL_DEPTH` plus the diagonal of a cell.
BAND_WIDTH = 2.75
# Points this close to the surface, in voxels, let no flood pass: neither straight nor diagonally.
SHELL_DEPTH = 0.9

# More than `_STACK` faces that are near more layers of blocks than this, on average, may be copies.
# Those that are equal to a millionth of a voxel count as such.
_MOST_LAYERS_A_FACE, _STACK, _COPY_GRID = 4, 256, 2.0**20
_FACES_PER_BAND = 1 << 14

# Points that all faces together may be near: this many, or this many times those of the grid. And
# blocks in the bounding boxes of all faces together: each face looks at those in its own.
_MOST_POINTS, _MOST_FILLS, _MOST_BLOCKS = 2.5e9, 8.0, 5e9


@dataclass(frozen=True, eq=False)
class Band:
    """Distances to a surface at the points near it, in units of a voxel."""

    # (nx, ny, nz) int32; row of each block of 8 x 8 x 8 points, -1 where it is far from the
    # surface.
    slots: IntArray
    corners: IntArray  # (n_slots, 3) int32; first point of each block with a row
    distances: Float32Array  # (n_slots, 512) float32; unsigned, at most `BAND_WIDTH`

    @property
    def shape(self) -> tuple[int, int, int]:
        """Points of the grid along each axis."""
        nx, ny, nz = (BLOCK_SIDE * n for n in self.slots.shape)
        return nx, ny, nz

    @classmethod
    def around(
        cls, positions: FloatArray, faces: IntArray, grid: Grid, *, threads: int | None = None
    ) -> Band:
        """Measure distances in a grid, in voxels; `MeshError` if that would take very long."""
        shape = grid.shape
        listed, starts = _faces_of_layers(positions, faces, shape[0])
        if len(listed) > _MOST_LAYERS_A_FACE * len(faces):
            copies = later_copies(np.rint(positions[faces] * _COPY_GRID).reshape(-1, 9))
            if np.count_nonzero(copies) > _STACK:
                faces = faces[~copies]
                listed, starts = _faces_of_layers(positions, faces, shape[0])
        grid.require_room(positions, faces, threads)
        mesh = (positions, faces, listed, starts)
        active = np.zeros(shape, dtype=np.bool_)
        mark = partial(core.mark_band_blocks, *mesh, active, BAND_WIDTH)
        run_bands(mark, shape[0], band=1, threads=threads)
        corners = np.ascontiguousarray(BLOCK_SIDE * np.argwhere(active), dtype=np.int32)
        slots = np.full(shape, -1, dtype=np.int32)
        slots[active] = np.arange(len(corners), dtype=np.int32)
        distances = np.empty((len(corners), BLOCK_POINTS), dtype=np.float32)
        measure = partial(core.measure_band, *mesh, slots, distances, BAND_WIDTH)
        run_bands(measure, shape[0], band=1, threads=threads)
        return cls(slots, corners, distances)

    def labels(self, *, threads: int | None = None) -> ByteArray:
        """Label the points of the whole grid `SHELL` near the surface, and `CORE` elsewhere."""
        labels = np.zeros(self.shape, dtype=np.uint8)
        label = partial(core.label_shell, self.slots, self.distances, labels, SHELL_DEPTH)
        run_bands(label, self.slots.shape[0], band=1, threads=threads)
        return labels

    def values_of(self, points: BoolArray) -> BoolArray:
        """Return values of the grid's points (nx, ny, nz) as those of blocks (n_slots, 512)."""
        nx, ny, nz = self.slots.shape
        blocks = points.reshape(nx, BLOCK_SIDE, ny, BLOCK_SIDE, nz, BLOCK_SIDE)
        return blocks.transpose(0, 2, 4, 1, 3, 5)[self.slots >= 0].reshape(-1, BLOCK_POINTS)


def _faces_of_layers(
    positions: FloatArray, faces: IntArray, n_layers: int
) -> tuple[IntArray, Int64Array]:
    """List the faces near each layer of blocks, in their order, and where each list starts."""
    along = np.ascontiguousarray(positions[:, 0])
    a, b, c = (along[faces[:, corner]] for corner in range(3))
    scale = 1.0 / BLOCK_SIDE
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    first = np.floor((low - BAND_WIDTH) * scale).astype(np.int64)
    last = np.floor((high + BAND_WIDTH) * scale).astype(np.int64)
    np.clip(first, 0, n_layers - 1, out=first)
    np.clip(last, 0, n_layers - 1, out=last)
    counts = last - first + 1
    ids = np.repeat(np.arange(len(faces), dtype=np.int32), counts)
    begins = np.cumsum(counts) - counts
    layers = np.repeat(first - begins, counts) + np.arange(len(ids))
    order = np.argsort(layers.astype(np.int16), kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(layers, minlength=n_layers))])
    return ids[order], starts.astype(np.int64)


# Voxels between the mesh and the border of the grid, besides the radius of the ball: the width of
# the band, and a point that is outside in any case.
_MARGIN = 4
# Points are snapped to this many cells per voxel, so that rounding of the model's coordinates does
# not affect them.
_CELLS = 2.0**24


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the voxels are, and how many: `voxels = (local - low) / side`."""

    name: str  # of the mesh, for messages
    resolution: int
    frame: LocalFrame
    low: FloatArray
    side: float
    gap: float  # in voxels
    shape: tuple[int, int, int]  # blocks along each axis

    @classmethod
    def around(cls, mesh: Mesh, options: RemeshOptions) -> Grid:
        """Place the grid, with a margin that is outside in any case."""
        frame = LocalFrame.around(mesh)
        low, high = frame.to_local(mesh.bounds)
        if not (high - low).max() > 0.0:
            raise MeshError(f"{mesh.name}: all of its corners are at one point; nothing to wrap")
        side = float((high - low).max()) / options.resolution
        gap = options.gap(float(pm.norm(high - low)) / float(frame.scale)) * frame.scale
        gap = max(float(snapped(gap / side, _CELLS)), 2.0 * SHELL_DEPTH)
        if gap > 2.0 * MAX_RADIUS:
            raise OptionError(
                f"close: {options.close} is wider than {2 * MAX_RADIUS} voxels; "
                "close less, or lower `resolution`"
            )
        margin = int(gap / 2.0) + _MARGIN
        n_points = np.ceil(snapped((high - low) / side, _CELLS)).astype(np.int64) + 1 + 2 * margin
        nx, ny, nz = (-(-n_points // BLOCK_SIDE)).tolist()
        low = low - margin * side
        return cls(mesh.name, options.resolution, frame, low, side, gap, (nx, ny, nz))

    @property
    def voxel(self) -> float:
        """Side of a voxel in model units."""
        return float(self.frame.length_to_model(self.side))

    def to_voxels(self, positions: FloatArray) -> FloatArray:
        """(V, 3) model units to voxels."""
        return snapped((self.frame.to_local(positions) - self.low) / self.side, _CELLS)

    def to_model(self, positions: FloatArray) -> FloatArray:
        """(V, 3) voxels to model units."""
        return self.frame.to_model(positions * self.side + self.low)

    def require_room(self, positions: FloatArray, faces: IntArray, threads: int | None) -> None:
        """Raise `MeshError` for triangles, in voxels, that fill the grid many times over."""
        n_points = 2.0 * BAND_WIDTH * float(face_areas(positions, faces, threads=threads).sum())
        blocks = np.empty(len(faces))

        def count_blocks(start: int, stop: int) -> None:
            a, b, c = (positions[faces[start:stop, corner]] for corner in range(3))
            sizes = np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)
            x, y, z = (sizes / BLOCK_SIDE + 1.0).T
            np.multiply(x * y, z, out=blocks[start:stop])

        run_bands(count_blocks, len(faces), band=_FACES_PER_BAND, threads=threads)
        n_blocks = float(blocks.sum())
        whole = float(np.prod(self.shape)) * BLOCK_POINTS
        if n_points <= max(_MOST_POINTS, _MOST_FILLS * whole) and n_blocks <= _MOST_BLOCKS:
            return
        # Areas fall with the square of the resolution, boxes with its cube.
        # Where all triangles are lines, only their boxes count.
        share = min(
            math.sqrt(_MOST_POINTS / max(n_points, 1.0)),
            pm.power(_MOST_BLOCKS / n_blocks, 1.0 / 3.0),
        )
        lower = int(share * self.resolution)
        lower_too = f"use a `resolution` of {lower}, or " if lower >= MIN_RESOLUTION else ""
        raise MeshError(
            f"{self.name}: its triangles are so many and so large that measuring the voxels around "
            f"them would take very long; {lower_too}wrap parts of it"
        )
