"""The points at which a procedure is evaluated, and the width of a pixel at each.

A pixel is a box around its point, with the same width along every axis or one width per axis.
Kernels read points and widths with `core/procedure_points.h`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.records import dataclass

# A function that evaluates the points start to stop - 1.
Work = Callable[[int, int], None]

# Points per band: a few milliseconds of work.
BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class ProcedurePoints:
    """Points at which to evaluate a procedure, and the array for the results."""

    # (n, 2 or 3) float64; contiguous; a missing third coordinate is 0.
    points: FloatArray
    # (n, 1) or (n, 2 or 3) float32; widths of the pixels along all axes or along each. None:
    # nothing is filtered.
    widths: Float32Array | None
    out: Float32Array  # (n, 1 or 3) float32; values from 0 to 1, or linear RGB

    @property
    def n_dimensions(self) -> int:
        """Number of coordinates per point."""
        return int(self.points.shape[1])


def checked_points(points: npt.ArrayLike) -> FloatArray:
    """Return points as a contiguous array; raise `OptionError` on another shape."""
    array = np.require(points, np.float64, ["C", "A"])
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise OptionError(
            f"points: the shape {array.shape} is not (n, 3) or (n, 2); give one row a point"
        )
    return array


def checked_widths(footprint: npt.ArrayLike | None, points: FloatArray) -> Float32Array | None:
    """Return widths for `ProcedurePoints`; raise `OptionError` if the shape is wrong."""
    if footprint is None:
        return None
    with np.errstate(over="ignore"):  # widths beyond float32 become infinite
        array = np.require(footprint, np.float32, ["C", "A"])
    if array.ndim == 1:
        array = array.reshape(-1, 1)
    n_points, n_dimensions = points.shape
    if array.ndim != 2 or len(array) != n_points or array.shape[1] not in (1, n_dimensions):
        raise OptionError(
            f"footprint: the shape {np.shape(footprint)} is not ({n_points},) or "
            f"({n_points}, {n_dimensions}); give the width of the pixel at each point"
        )
    return array


@lru_cache(maxsize=64)
def unit_vector(direction: tuple[float, float, float]) -> FloatArray:
    """Normalize a nonzero direction; return (3,) float64, read-only."""
    vector = np.asarray(np.array(direction, np.float64) / pm.norm(direction))
    vector.flags.writeable = False
    return vector
