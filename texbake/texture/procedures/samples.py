"""Where a procedure is evaluated, how wide a pixel is there, and how detail fades with that.

A pixel is a box about its point: as wide along every axis, or with a width of its own along each.

`coordinates`, `widest`, `span_along` and `kept_of` can be called from the kernels of other modules.

Based on: Apodaca and Gritz, "Advanced RenderMan", 2000, chapter 11 (fading to the mean by the width
of the filter).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.texture.procedures.lattice import bounded

# Work over points start to stop - 1.
Work = Callable[[int, int], None]

# Points a band: some milliseconds of work.
BAND = 1 << 14

# Pixels wider than this are as wide as this; every pattern has reached its mean long before.
_WIDEST = 2.0**50
# Of a cell: noise is kept whole in pixels up to a fourth of a cell and gone where a pixel is as
# wide as a cell. Noise averaged over a square keeps 0.96 and 0.62 of its contrast there; the rest
# is what would alias, since a cell is about one period and two pixels a period are the limit.
_KEPT_BELOW = 0.25
_GONE_ABOVE = 1.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Points to evaluate, and where the results go.

    Attributes
    ----------
    points : (n, 2 or 3) float64
        Read-only, contiguous; a third coordinate that is not there is 0.
    widths : (n, 1), (n, 2 or 3) or (0, 1) float32
        Widths of the pixels along all axes or along each; none: nothing is filtered.
    out : (n, 1 or 3) float32
        Values from 0 to 1, or linear RGB.
    """

    points: npt.NDArray[np.float64]
    widths: npt.NDArray[np.float32]
    out: npt.NDArray[np.float32]

    @property
    def n_dimensions(self) -> int:
        """Number of coordinates that the points have."""
        return int(self.points.shape[1])


def checked_points(points: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return points as a contiguous, read-only array; raise `OptionError` on another shape."""
    array = _readable(points, np.float64)
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise OptionError(
            f"points: the shape {array.shape} is not (n, 3) or (n, 2); give one row a point"
        )
    return array


def checked_widths(
    footprint: npt.ArrayLike | None, points: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
    """Return the widths of pixels as `Samples` has them; raise `OptionError` on another shape."""
    if footprint is None:
        return _NO_WIDTHS
    with np.errstate(over="ignore"):  # too wide for float32 is infinitely wide
        array = _readable(footprint, np.float32)
    if array.ndim == 1:
        array = array.reshape(-1, 1)
    n_points, n_dimensions = points.shape
    if array.ndim != 2 or len(array) != n_points or array.shape[1] not in (1, n_dimensions):
        raise OptionError(
            f"footprint: the shape {np.shape(footprint)} is not ({n_points},) or "
            f"({n_points}, {n_dimensions}); give the width of the pixel at each point"
        )
    return array


def _readable(values: npt.ArrayLike, dtype: type) -> npt.NDArray[Any]:
    """Return values as a contiguous, read-only array, so that kernels have one signature."""
    array = np.require(values, dtype, "C").view()
    array.flags.writeable = False
    return array


_NO_WIDTHS = _readable(np.empty((0, 1)), np.float32)


@kernel
def coordinates(points, i):  # type: ignore[no-untyped-def]
    """Three finite coordinates of a point; see `lattice.bounded`."""
    z = bounded(points[i, 2]) if points.shape[1] > 2 else 0.0
    return bounded(points[i, 0]), bounded(points[i, 1]), z


@kernel
def width_along(widths, i, axis):  # type: ignore[no-untyped-def]
    """Width of a pixel along an axis; 0 where nothing is filtered or it is not a number."""
    if len(widths) == 0 or (widths.shape[1] > 1 and axis >= widths.shape[1]):
        return 0.0
    width = np.float64(widths[i, axis if widths.shape[1] > 1 else 0])
    return min(width, _WIDEST) if width > 0.0 else 0.0


@kernel
def widest(widths, i):  # type: ignore[no-untyped-def]
    """Largest width of a pixel along any axis."""
    return max(width_along(widths, i, 0), width_along(widths, i, 1), width_along(widths, i, 2))


@kernel
def span_along(widths, i, direction):  # type: ignore[no-untyped-def]
    """How far a pixel reaches along a direction, a unit vector."""
    if widths.shape[1] == 1:
        return width_along(widths, i, 0)
    span = 0.0
    for axis in range(3):
        span += abs(direction[axis]) * width_along(widths, i, axis)
    return span


@kernel
def kept_of(cells):  # type: ignore[no-untyped-def]
    """Share of its contrast that noise keeps in a pixel so many cells wide, from 1 down to 0."""
    t = (cells - _KEPT_BELOW) / (_GONE_ABOVE - _KEPT_BELOW)
    t = min(max(t, 0.0), 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)
