"""A height field known in closed form, with its slopes: a few waves over the unit square."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

# Whole periods along x and y, so that it tiles; phase, and amplitude in sides of the square.
_WAVES = ((3, 2, 0.4, 0.012), (-5, 7, 1.3, 0.005), (11, -4, 2.1, 0.0025), (13, 17, 0.7, 0.001))
_TURN = 2.0 * np.pi


def wave_heights(x: npt.NDArray[Any], y: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Heights h(x, y), in the precision of the coordinates."""
    return sum((a * np.sin(_angle(x, y, m, n, p)) for m, n, p, a in _WAVES), start=0 * x)


def wave_slopes(
    x: npt.NDArray[Any], y: npt.NDArray[Any]
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Slopes dh/dx and dh/dy."""
    turns = [(m, n, a * np.cos(_angle(x, y, m, n, p))) for m, n, p, a in _WAVES]
    along = sum((x.dtype.type(_TURN * m) * c for m, _, c in turns), start=0 * x)
    up = sum((x.dtype.type(_TURN * n) * c for _, n, c in turns), start=0 * x)
    return along, up


def wave_normals(x: npt.NDArray[Any], y: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """(..., 3) unit normals, x to the right, y up."""
    along, up = wave_slopes(x, y)
    normals = np.stack([-along, -up, np.ones_like(along)], axis=-1)
    return np.asarray(normals / np.sqrt(np.square(normals).sum(axis=-1, keepdims=True)))


def texel_grid(size: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return x and y, (size, size) each, of the texels of an image; row 0 is the top."""
    middles = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(middles, middles[::-1])
    return x, y


def _angle(x: npt.NDArray[Any], y: npt.NDArray[Any], m: int, n: int, p: float) -> npt.NDArray[Any]:
    of = x.dtype.type
    return np.asarray(of(_TURN * m) * x + of(_TURN * n) * y + of(p))
