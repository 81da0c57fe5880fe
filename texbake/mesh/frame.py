"""The local frame: meshes moved and scaled together into the unit cube about the origin.

Whatever works in float32 (ray casting) or with absolute thresholds works in it, so that the size
and place of a model change nothing.

The scale is a power of two, so that scaling changes no bits and only the move to the center rounds.
Lengths convert exactly both ways.

Code that chooses among equal costs (which edge collapses next, where a chart is cut) works on a
`UnitGrid`, whose points do not change where a model is scaled by another factor, or moved.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.mesh.streamed.mesh import StreamedMesh


@dataclass(frozen=True, eq=False)
class LocalFrame:
    """A move and a uniform scale: ``local = (model - center) * scale``."""

    center: FloatArray  # (3,) float64; the point in model space that is the local origin; read-only
    scale: float  # local units per model unit; a power of two in the frames that `around` makes

    @classmethod
    def around(cls, *meshes: Mesh | StreamedMesh) -> LocalFrame:
        """Frame with the joint bounding box centered, its longest side in (0.5, 1] local units."""
        if not meshes:
            raise MeshError("local frame: there is no mesh to put it around; give at least one")
        corners = np.concatenate([mesh.bounds for mesh in meshes])
        # Halved first: the sum or difference of coordinates near the largest float64 overflows.
        low, high = corners.min(axis=0) / 2.0, corners.max(axis=0) / 2.0
        center = low + high
        center.flags.writeable = False
        half_size = float((high - low).max())
        return cls(center, unit_scale(half_size) / 2.0 if half_size > 0.0 else 1.0)

    def to_local(self, points: npt.ArrayLike) -> FloatArray:
        """(..., 3) float64: points of model space in local coordinates."""
        with np.errstate(over="ignore"):  # of a vertex that no face uses
            local = np.asarray(np.asarray(points, dtype=np.float64) - self.center)
            local *= self.scale
        return local

    def to_model(self, points: npt.ArrayLike) -> FloatArray:
        """(..., 3) float64: local points in model coordinates."""
        return np.asarray(np.asarray(points, dtype=np.float64) / self.scale + self.center)

    def length_to_local(self, lengths: npt.ArrayLike) -> FloatArray:
        """Lengths in model units as local ones, of the same shape."""
        return np.asarray(np.asarray(lengths, dtype=np.float64) * self.scale)

    def length_to_model(self, lengths: npt.ArrayLike) -> FloatArray:
        """Local lengths in model units, of the same shape."""
        return np.asarray(np.asarray(lengths, dtype=np.float64) / self.scale)


# Borders between cells of a grid are shifted by this fraction of a cell, so that coordinates on a
# regular raster (binary or decimal) do not lie on them, where the last bit would decide.
_PHASE = 0.3090169943749474  # (sqrt(5) - 1) / 4

# A sixteenth of a step of float32, so that this grid adds no error that a scan does not have, and
# 2^24 times the rounding error of float64.
_CELLS = 2.0**28


def snapped(values: npt.ArrayLike, cells: float, *, unit: float = 1.0) -> FloatArray:
    """Values as multiples of a unit, snapped to steps of 1 / cells; snapped ones do not change."""
    steps = np.asarray(np.asarray(values) * (cells / unit))
    steps -= _PHASE
    np.rint(steps, out=steps)
    steps /= cells
    return steps


@dataclass(frozen=True, eq=False)
class UnitGrid:
    """A frame of unit size with points on a grid: those of a scaled or moved mesh are the same."""

    frame: LocalFrame
    side: float  # the longest side in local units; 0 where all points are equal

    @classmethod
    def around(cls, *meshes: Mesh | StreamedMesh) -> UnitGrid:
        """Grid about the center of the joint bounding box of meshes."""
        frame = LocalFrame.around(*meshes)
        corners = np.concatenate([frame.to_local(mesh.bounds) for mesh in meshes])
        return cls(frame, float((corners.max(axis=0) - corners.min(axis=0)).max()))

    def to_grid(self, points: npt.ArrayLike, cells: float = _CELLS) -> FloatArray:
        """(..., 3) float64: points of model space on a grid of `cells` cells along its side."""
        # Positions that no face uses can be anywhere, even where numbers overflow.
        local = self.frame.to_local(points)
        np.clip(local, -1.0, 1.0, out=local)
        return snapped(local, cells, unit=self.side or np.inf)

    def length_to_grid(self, lengths: npt.ArrayLike) -> FloatArray:
        """Lengths in model units as shares of the longest side."""
        return self.frame.length_to_local(lengths) / (self.side or 1.0)

    def length_to_model(self, lengths: npt.ArrayLike) -> FloatArray:
        """Shares of the longest side as lengths in model units."""
        return self.frame.length_to_model(np.asarray(lengths) * (self.side or 1.0))


def unit_scale(size: float) -> float:
    """Greatest power of two that float64 has and that scales a size to at most 1; 1 for 0."""
    if size == 0.0:
        return 1.0
    mantissa, exponent = math.frexp(size)  # size = mantissa * 2^exponent, mantissa in [0.5, 1)
    if mantissa == 0.5:
        exponent -= 1
    return math.ldexp(1.0, min(-exponent, 1023))
