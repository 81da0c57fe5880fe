"""The pores of an orange: how deep a direction on the unit sphere lies below its peel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray

N_CELLS = 48  # a side of the grid that finds the pores near a direction; see `_pore_cells`


@kernel
def pore_depth_kernel(
    directions: FloatArray,
    centers: FloatArray,
    radii: FloatArray,
    pore_depths: FloatArray,
    cell_starts: npt.NDArray[np.int64],
    cell_pores: npt.NDArray[np.int64],
    depths: FloatArray,
) -> None:
    """Write how far the pores sink the peel in each direction, in units of its radius."""
    for k in range(len(directions)):
        x, y, z = directions[k, 0], directions[k, 1], directions[k, 2]
        cell = 0
        for value in (x, y, z):
            column = int(np.floor((value + 1.0) * (0.5 * N_CELLS)))
            cell = cell * N_CELLS + min(max(column, 0), N_CELLS - 1)
        depth = 0.0
        for slot in range(cell_starts[cell], cell_starts[cell + 1]):
            pore = cell_pores[slot]
            dx, dy, dz = x - centers[pore, 0], y - centers[pore, 1], z - centers[pore, 2]
            inside = 1.0 - (dx * dx + dy * dy + dz * dz) / (radii[pore] * radii[pore])
            if inside > 0.0:  # cubed: the rim has two continuous derivatives
                depth += pore_depths[pore] * inside * inside * inside
        depths[k] = depth
