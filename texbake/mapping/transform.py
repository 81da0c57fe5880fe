"""What happens to texture coordinates after a mapping: warp, flip, rotate, scale, texel density.

The warps are non-linear maps of (s, t): twirl, bulge, power, or the caller's own function. Twirl
and bulge leave everything outside the circle of radius 1/2 about (1/2, 1/2) unchanged and blend
into it smoothly, so that a tiling texture still tiles. None of the three folds the texture over.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError, UvError
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.projection import WARPS, WarpFunction
from texbake.mesh.mesh import FloatArray, Mesh

_MIDDLE = 0.5
_RADIUS = 0.5


def transform_uvs(coordinates: FloatArray, options: UnwrapOptions) -> FloatArray:
    """Apply warp, flip, rotation and scale, in this order, to (..., 2) coordinates."""
    flat = coordinates.reshape(-1, 2)
    if options.warp is not None:
        flat = warp_uvs(flat, options.warp)
    for axis, letter in enumerate("st"):
        if options.flip is not None and letter in options.flip:
            flat = np.where(np.arange(2) == axis, 1.0 - flat, flat)
    if options.rotate:
        flat = _rotated(flat, options.rotate)
    if options.scales != (1.0, 1.0):
        flat = flat * np.array(options.scales)
    return flat.reshape(coordinates.shape)


def scale_to_density(mesh: Mesh, corners: FloatArray, options: UnwrapOptions) -> FloatArray:
    """Scale corners (F, 3, 2) to the texel density of the options for the whole mesh."""
    if options.texel_density is None:
        return corners
    side = math.sqrt(options.width_px * options.height_px)
    in_texture = float(np.abs(signed_areas(corners)).sum())
    in_space = float(surface_areas(mesh.positions[mesh.faces]).sum())
    if not (in_texture > 0.0 and in_space > 0.0):
        raise UvError(
            f"{mesh.name}: its faces have no area, so they cannot have a texel density; "
            "look for the cause with: texbake info"
        )
    density = side * math.sqrt(in_texture / in_space)
    return corners * (options.texel_density / density)


def _rotated(flat: FloatArray, degrees: float) -> FloatArray:
    """Rotate counter-clockwise about (1/2, 1/2); exact for multiples of 90 degrees."""
    quarters, rest = divmod(degrees, 90.0)
    cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][int(quarters) % 4]
    if rest:
        cos, sin = pm.cos(math.radians(degrees)), pm.sin(math.radians(degrees))
    x, y = flat[:, 0] - 0.5, flat[:, 1] - 0.5
    return np.stack([cos * x - sin * y + 0.5, sin * x + cos * y + 0.5], axis=1)


def warp_uvs(coordinates: FloatArray, warp: str | tuple[str, float] | WarpFunction) -> FloatArray:
    """Apply a warp to (n, 2), given by name, by name and strength, or as a function of a copy."""
    if callable(warp):
        return _checked(warp(coordinates.copy()), len(coordinates))
    name, strength = (warp, WARPS[warp]) if isinstance(warp, str) else warp
    return _WARPS[name](coordinates, strength)


def twirl(coordinates: FloatArray, degrees: float) -> FloatArray:
    """Rotate points by degrees (1 - (r / R)²)² about the texture's center, R = 1/2."""
    about = coordinates - _MIDDLE
    angles = np.radians(degrees) * _weights(about)
    cos, sin = pm.cos(angles), pm.sin(angles)
    turned = np.stack(
        [about[:, 0] * cos - about[:, 1] * sin, about[:, 0] * sin + about[:, 1] * cos], axis=1
    )
    return np.where(angles[:, None] == 0.0, coordinates, turned + _MIDDLE)


def bulge(coordinates: FloatArray, strength: float) -> FloatArray:
    """Magnify the center of the texture by 1 / (1 - strength); a negative strength shrinks it."""
    about = coordinates - _MIDDLE
    weights = _weights(about)[:, None]
    return np.where(weights == 0.0, coordinates, _MIDDLE + about * (1.0 - strength * weights))


def power(coordinates: FloatArray, exponent: float) -> FloatArray:
    """Raise s and t to a power within each tile; whole numbers do not move."""
    tiles = np.floor(coordinates)
    return np.asarray(tiles + pm.power(coordinates - tiles, exponent))


_WARPS: dict[str, Callable[[FloatArray, float], FloatArray]] = {
    "twirl": twirl,
    "bulge": bulge,
    "power": power,
}


def _weights(about: FloatArray) -> FloatArray:
    """(n,): 1 at the center, falling to 0 at the radius, where the slope is 0 too."""
    squares = np.minimum(pm.vecdot(about, about) / _RADIUS**2, 1.0)
    return np.asarray((1.0 - squares) ** 2)


def _checked(values: object, n_values: int) -> FloatArray:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (n_values, 2):
        raise OptionError(f"warp: the function must return numbers of shape ({n_values}, 2)")
    if not np.isfinite(array).all():
        raise OptionError("warp: the function returned a number that is not finite")
    return array
