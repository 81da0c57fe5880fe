"""Where the voxels around a mesh are, and how many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.frame import LocalFrame, snapped
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.remesh_options import MIN_RESOLUTION, RemeshOptions
from texbake.mesh.remeshing.band import BLOCK_SIDE, SHELL_DEPTH, CrowdedGridError
from texbake.mesh.remeshing.flood import MAX_RADIUS

# Voxels between the mesh and the border of the grid, besides the radius of the ball: the width of
# the band, and a point that is outside in any case.
_MARGIN = 4
# Points are snapped to this many cells per voxel, so that rounding of the model's coordinates does
# not affect them.
_CELLS = 2.0**24


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the voxels are, and how many: `voxels = (local - low) / side`."""

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
        return cls(frame, low - margin * side, side, gap, (nx, ny, nz))

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


def too_crowded(mesh: Mesh, options: RemeshOptions, error: CrowdedGridError) -> MeshError:
    """Say what to do about triangles that fill the grid many times over."""
    lower = int(error.share * options.resolution)
    lower_too = f"use a `resolution` of {lower}, or " if lower >= MIN_RESOLUTION else ""
    return MeshError(
        f"{mesh.name}: its triangles are so many and so large that measuring the voxels around "
        f"them would take very long; {lower_too}wrap parts of it"
    )
