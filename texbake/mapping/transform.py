"""What happens to coordinates after they have been mapped: warp, flip, turn, scale, move."""

from __future__ import annotations

import math

import numpy as np

from texbake.errors import UvError
from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.warp import warped
from texbake.mesh.mesh import FloatArray, Mesh


def transformed(coordinates: FloatArray, options: UnwrapOptions) -> FloatArray:
    """Apply the warp, the flip, the rotation and the scale, in this order.

    Parameters
    ----------
    coordinates : (..., 2) float64
    options : UnwrapOptions
        Its `warp`, `flip`, `rotate` and `scale`.

    Returns
    -------
    (..., 2) float64
        Equal to the bit where nothing is asked for.
    """
    flat = coordinates.reshape(-1, 2)
    if options.warp is not None:
        flat = warped(flat, options.warp)
    for axis, letter in enumerate("st"):
        if options.flip is not None and letter in options.flip:
            flat = np.where(np.arange(2) == axis, 1.0 - flat, flat)
    if options.rotate:
        flat = _rotated(flat, options.rotate)
    if options.scales != (1.0, 1.0):
        flat = flat * np.array(options.scales)
    return flat.reshape(coordinates.shape)


def at_density(mesh: Mesh, corners: FloatArray, options: UnwrapOptions) -> FloatArray:
    """Scale coordinates so that the mesh has the texel density asked for, as a whole.

    Parameters
    ----------
    mesh : Mesh
    corners : (F, 3, 2) float64
    options : UnwrapOptions
        Its `texel_density`, in texels a model unit, and its size.

    Returns
    -------
    (F, 3, 2) float64
        `corners` itself where no density is asked for.

    Raises
    ------
    UvError
        The faces have no area in space or in the texture.
    """
    if options.texel_density is None:
        return corners
    side = math.sqrt(options.width_px * options.height_px)
    in_texture = float(np.abs(signed_areas(corners)).sum())
    in_space = float(surface_areas(mesh.positions[mesh.faces]).sum())
    if not (in_texture > 0.0 and in_space > 0.0):
        raise UvError(
            f"{mesh.name}: its faces have no area, so that no texel density can be given to them; "
            "look for what is wrong with: texbake info"
        )
    density = side * math.sqrt(in_texture / in_space)
    return corners * (options.texel_density / density)


def _rotated(flat: FloatArray, degrees: float) -> FloatArray:
    """Turn counter-clockwise about (1/2, 1/2); exact by multiples of 90 degrees."""
    quarters, rest = divmod(degrees, 90.0)
    cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][int(quarters) % 4]
    if rest:
        cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = flat[:, 0] - 0.5, flat[:, 1] - 0.5
    return np.stack([cos * x - sin * y + 0.5, sin * x + cos * y + 0.5], axis=1)
