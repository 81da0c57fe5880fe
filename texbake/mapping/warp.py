"""Non-linear maps of (s, t): twirl, bulge, a power, or a function of the caller's own.

The two round ones leave everything outside the circle of radius 1/2 about (1/2, 1/2) as it is, and
reach it smoothly, so that a texture that tiles still does. None of them folds the texture over.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texbake.errors import OptionError
from texbake.mapping.options.transform import WARPS, WarpFunction
from texbake.mesh.mesh import FloatArray

_MIDDLE = 0.5
_RADIUS = 0.5


def warped(coordinates: FloatArray, warp: str | tuple[str, float] | WarpFunction) -> FloatArray:
    """Apply a warp by name, by name and strength, or a function.

    Parameters
    ----------
    coordinates : (n, 2) float64
    warp
        As in `TransformOptions`. A function gets a copy, (n, 2), and returns as many coordinates.

    Returns
    -------
    (n, 2) float64

    Raises
    ------
    OptionError
        The function returns another shape or what is not finite.
    """
    if callable(warp):
        return _checked(warp(coordinates.copy()), len(coordinates))
    name, strength = (warp, WARPS[warp]) if isinstance(warp, str) else warp
    return _WARPS[name](coordinates, strength)


def twirl(coordinates: FloatArray, degrees: float) -> FloatArray:
    """Turn points about the middle, by `degrees` there and by 0 at the radius 1/2.

    The angle falls off as (1 - (r / R)²)², so that the map and its first derivative are continuous.

    Examples
    --------
    >>> twirl(np.array([[0.5, 0.5], [1.0, 0.5], [3.0, 0.0]]), 90.0)
    array([[0.5, 0.5],
           [1. , 0.5],
           [3. , 0. ]])
    """
    about = coordinates - _MIDDLE
    angles = np.radians(degrees) * _weights(about)
    cos, sin = np.cos(angles), np.sin(angles)
    turned = np.stack(
        [about[:, 0] * cos - about[:, 1] * sin, about[:, 0] * sin + about[:, 1] * cos], axis=1
    )
    return np.where(angles[:, None] == 0.0, coordinates, turned + _MIDDLE)


def bulge(coordinates: FloatArray, strength: float) -> FloatArray:
    """Magnify the texture's middle by 1 / (1 - strength); a negative strength shrinks it.

    The distance from the middle becomes r (1 - strength (1 - (r / R)²)²), which grows with r for
    strengths above -1.25 and below 1.
    """
    about = coordinates - _MIDDLE
    weights = _weights(about)[:, None]
    return np.where(weights == 0.0, coordinates, _MIDDLE + about * (1.0 - strength * weights))


def power(coordinates: FloatArray, exponent: float) -> FloatArray:
    """Take s and t to a power within each tile, so that whole numbers stay where they are.

    Examples
    --------
    >>> power(np.array([[0.5, 1.5], [-0.5, 1.0]]), 2.0)
    array([[ 0.25,  1.25],
           [-0.75,  1.  ]])
    """
    tiles = np.floor(coordinates)
    return np.asarray(tiles + (coordinates - tiles) ** exponent)


_WARPS: dict[str, Callable[[FloatArray, float], FloatArray]] = {
    "twirl": twirl,
    "bulge": bulge,
    "power": power,
}


def _weights(about: FloatArray) -> FloatArray:
    """(n,): 1 at the middle, falling to 0 at the radius, where its slope is 0 too."""
    squares = np.minimum(np.einsum("ij,ij->i", about, about) / _RADIUS**2, 1.0)
    return np.asarray((1.0 - squares) ** 2)


def _checked(values: object, n_values: int) -> FloatArray:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (n_values, 2):
        raise OptionError(f"warp: the function must return ({n_values}, 2) numbers")
    if not np.isfinite(array).all():
        raise OptionError("warp: the function returned a number that is not finite")
    return array
