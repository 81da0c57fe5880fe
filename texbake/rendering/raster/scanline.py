"""The classical scanline rasterizer: walk down the edges row by row, then along each row.

It exists for teaching and as an independent check of `texbake.rendering.raster.rasterize`: it runs
on one thread, and rounding errors accumulate along a span.

Kernel: `core/scanline_rasterizer.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray
from texbake.rendering.raster.world import VisibilityBuffer, World


def rasterize_scanlines(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    modes: npt.NDArray[np.uint8],
) -> tuple[VisibilityBuffer, FloatArray]:
    """Rasterize triangles by scanlines, with the barycentric weights at each sample.

    Returns `weights` (height, width, 2) float64: weights of the second and third corner; 0 where
    there is no triangle.
    """
    face_ids = np.full((height, width), -1, np.int32)
    depths = np.zeros((height, width), np.float32)
    weights = np.zeros((height, width, 2))
    core.draw_scanlines(
        world.positions, world.faces, world.starts, modes, clip_from_world,
        face_ids, depths, weights,
    )  # fmt: skip
    return VisibilityBuffer(face_ids, depths), weights
