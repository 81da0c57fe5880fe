"""Box mapping: each face is projected onto one of the six sides of a box.

The six pictures lie in the texture as the sides of a die seen from outside, each upright, all at
one scale and with square texels:

    +----+ +----+ +----+
    | +x | | +y | | +z |
    +----+ +----+ +----+
    +----+ +----+ +----+
    | -x | | -y | | -z |
    +----+ +----+ +----+

Based on: Bier, Sloan, "Two-part texture mappings", 1986 (the box, by the object's normal). It
departs in choosing the side by face, not by point, so that no face is torn, and in smoothing the
choice; see `box_sides`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mapping.classical.box_sides import N_SIDES, box_sides
from texbake.mapping.classical.frames import center_of, in_frame, points_about, upright_frame
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import FloatArray, Mesh


def box(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh onto the six sides of a box about its center.

    Examples
    --------
    >>> from texbake.mesh.shapes import cube
    >>> corners = box(cube(), UnwrapOptions(method="box", size=(300, 200), padding=0)).corners
    >>> float(corners.min()), float(corners.max())
    (0.0, 1.0)
    """
    found = box_sides(mesh)
    local = points_about(mesh, center_of(mesh, options.center), np.eye(3))
    points = local.points[mesh.faces]
    half_size = np.array([np.abs(points[:, :, i]).max() for i in range(3)])
    half_size[half_size <= local.rounding] = 0.0
    counts = {
        "faces joined to the side of their neighbors": found.n_joined,
        "faces without area": found.n_without_normal,
    }
    return Projected(
        corners=side_pictures(points, found.sides, half_size, options),
        tallies=counts,
    )


def side_pictures(
    points: FloatArray,
    sides: npt.NDArray[np.integer[Any]],
    half_size: FloatArray,
    options: UnwrapOptions,
) -> FloatArray:
    """Project faces onto the sides of a box and arrange the six pictures in the texture.

    `points` (F, 3, 3) float64: corners relative to the center of the box, +y up in the pictures;
    `sides` (F,) int: 0 to 5 for +x, -x, +y, -y, +z, -z; `half_size` (3,) float64. Returns (F, 3, 2)
    float64.
    """
    if options.overlap:
        size = np.ones(2)
        middles, per_length = np.full((N_SIDES, 2), 0.5), _scale(0.5, half_size.max())
    else:
        size = np.array([options.width_px, options.height_px], dtype=np.float64)
        middles, per_length = _cells(half_size, size, options.padding or 0)
    corners = np.empty((len(points), 3, 2))
    for side, axis in enumerate(np.repeat(np.eye(3), 2, axis=0)):
        at_side = sides == side
        frame = upright_frame(axis if side % 2 == 0 else -axis)
        corners[at_side] = (
            in_frame(points[at_side], frame[:2]) * per_length + middles[side]
        ) / size
    return corners


def _cells(half_size: FloatArray, size: FloatArray, padding: int) -> tuple[FloatArray, float]:
    """(6, 2) centers of the cells, and texels per local unit.

    Columns are as wide as their sides, and both rows as high as the highest side.
    """
    half_widths = half_size[[2, 0, 0]]
    half_height = half_size[1:].max()
    free = size - np.array([4.0, 3.0]) * padding
    if (free <= 0.0).any():
        raise OptionError(
            f"padding: {padding} texels around six sides leave nothing of "
            f"{size[0]:.0f} x {size[1]:.0f}; use less padding or a larger size"
        )
    per_length = _scale(free, np.array([2.0 * half_widths.sum(), 4.0 * half_height]))
    half_widths, half_height = half_widths * per_length, half_height * per_length
    s = np.cumsum(2.0 * half_widths + padding) - half_widths
    t = padding + half_height + np.array([2.0 * half_height + padding, 0.0])
    return np.stack([np.repeat(s, 2), np.tile(t, 3)], axis=1), per_length


def _scale(free: npt.ArrayLike, needed: npt.ArrayLike) -> float:
    """Largest scale at which all lengths fit into the free space; 1 if all lengths are 0."""
    with np.errstate(divide="ignore"):
        scale = float(np.min(np.asarray(free) / needed))
    return scale if math.isfinite(scale) else 1.0
