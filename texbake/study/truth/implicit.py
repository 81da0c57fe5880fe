"""Surfaces given by a function that is 0 on them, below 0 inside and above 0 outside.

Normals are the gradient of the function, and where lines meet the surface is found by Newton's
method along them. Slopes are central differences, whose error of about h^2 = 1e-10 is far below
what any map holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray

_STEP = 1e-5  # in the units of the surface, which is about one unit wide
_ROUNDS = 20
_MOST_STEP = 0.05
# Value that counts as on the surface.
_ON_SURFACE = 1e-9


class Surface(Protocol):
    """A surface whose normals and points are known exactly."""

    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals at or near points (n, 3)."""

    def hits(
        self, starts: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return where lines meet the surface near points that lie close to it.

        `starts` (n, 3) float64; `directions` (n, 3) float64: unit vectors of the lines through
        them. Returns `points` (n, 3) float64; `converged` (n,) bool: false for a line that only
        touches the surface, or passes by.
        """


def meet_lines(
    value: Callable[[FloatArray], FloatArray],
    slopes: Callable[[FloatArray, FloatArray], FloatArray],
    starts: FloatArray,
    directions: FloatArray,
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Follow lines to where a function is 0, by Newton's method; `Surface.hits` of all surfaces.

    `slopes` gives the slopes of the function at (n, 3) points along (n, 3) directions.
    """
    points = np.array(starts)
    for _ in range(_ROUNDS):
        values, along = value(points), slopes(points, directions)
        step = np.where(np.abs(along) > 1e-3, values / np.where(along == 0.0, 1.0, along), 0.0)
        points -= np.clip(step, -_MOST_STEP, _MOST_STEP)[:, None] * directions
        if np.abs(values).max(initial=0.0) < 0.01 * _ON_SURFACE:
            break
    return points, np.abs(value(points)) < _ON_SURFACE


@dataclass(frozen=True, eq=False)
class ImplicitSurface:
    """A surface where `value` is 0."""

    # From (n, 3) points to (n,) values, smooth near the surface, with slopes of about 1.
    value: Callable[[FloatArray], FloatArray]

    def gradients(self, points: FloatArray) -> FloatArray:
        """(n, 3) slopes of the function along x, y and z."""
        columns = [self._slopes(points, axis) for axis in np.eye(3)]
        return np.stack(columns, axis=1)

    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals at or near points (n, 3)."""
        found = self.gradients(points)
        lengths = np.sqrt(pm.vecdot(found, found))
        return np.asarray(found / np.where(lengths > 0.0, lengths, 1.0)[:, None])

    def distances(self, points: FloatArray) -> FloatArray:
        """(n,) distances of points that lie close to the surface, to first order."""
        found = self.gradients(points)
        return np.asarray(np.abs(self.value(points)) / np.sqrt(pm.vecdot(found, found)))

    def hits(
        self, starts: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return where lines meet the surface near points that lie close to it; see `Surface`."""
        return meet_lines(self.value, self._slopes, starts, directions)

    def _slopes(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        step = _STEP * directions
        return np.asarray((self.value(points + step) - self.value(points - step)) / (2.0 * _STEP))
