"""Snapping vertices to the fixed-point grid of the screen.

The screen has width x height samples, each at the center of its cell, with row 0 at the top.
Positions are integers in 1/256 of a sample, so coverage is decided exactly. Triangles with a corner
off the grid are clipped when they are drawn.

Kernel: `core/clipping.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands

# Units of the grid in a sample, and the column that marks a vertex outside the grid; as in
# `core/clipping.h`.
SUBPIXELS = 256
OFF_GRID = np.iinfo(np.int32).min

# Vertices per band: about a millisecond of work.
_BAND = 65536


def project(
    positions: FloatArray,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    threads: int | None = None,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Snap vertices to the grid of the screen.

    `positions` (V, 3) float64: world space; `clip_from_world` (4, 4) float64. Returns `grid` (V, 2)
    int32, `depths` (V,) float32: z / w of the vertices that are on the grid.
    """
    grid = np.zeros((len(positions), 2), np.int32)
    depths = np.zeros(len(positions), np.float32)

    def work(start: int, stop: int) -> None:
        core.project_vertices(positions, clip_from_world, width, height, grid, depths, start, stop)

    run_bands(work, len(positions), band=_BAND, threads=threads)
    return grid, depths
