"""How points of a mesh look in a photograph, whatever says where it shows them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray

# Points a band: some milliseconds of work.
BAND = 1 << 15


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a mesh.

    Attributes
    ----------
    faces : (n,) int32
    barycentrics : (n, 2) float64
        Weights of the second and third corner.
    places, normals : (n, 3) float64
        In the local frame; normals are smooth unit vectors, or zero.
    """

    faces: IntArray
    barycentrics: FloatArray
    places: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class Views:
    """How points look in one photograph.

    Attributes
    ----------
    ids : (m,) int64
        Which of the points the photograph shows, ascending.
    coordinates : (m, 2) float64
        In the photograph, v up.
    derivatives : (m, 4) float32
        du/dx, dv/dx, du/dy, dv/dy with x and y in samples of the baked texture.
    weights : (m,) float64
        Above 0, up to 1.
    """

    ids: npt.NDArray[np.int64]
    coordinates: FloatArray
    derivatives: npt.NDArray[np.float32]
    weights: FloatArray


class PhotoSource(Protocol):
    """Tells how points look in one photograph."""

    def views(self, points: SurfacePoints) -> Views:
        """How the points look that it shows."""


@kernel
def border_weight(u, v, feather):  # type: ignore[no-untyped-def]
    """0 outside the unit square and on its border, 1 from `feather` inwards, smoothly between."""
    if not (0.0 < u < 1.0 and 0.0 < v < 1.0):
        return 0.0
    inside = min(min(u, 1.0 - u), min(v, 1.0 - v))
    if inside >= feather:
        return 1.0
    share = inside / feather
    return share * share * (3.0 - 2.0 * share)
