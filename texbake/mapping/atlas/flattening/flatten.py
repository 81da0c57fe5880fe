"""Patches of triangles flattened with as little distortion as possible and a free boundary.

Kernels: `core/flatten.c`, which names the methods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """A flattened patch, with the area that it has in space and without flipped triangles."""

    # (n, 2) float64; coordinates in the unit of the points, about the origin; 0 for unused
    # vertices.
    uvs: FloatArray
    # Stretch of the patch at this scale (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2, 1 at
    # best.
    l2: float
    energy: float  # mean of the symmetric Dirichlet energy at this scale, 4 at best
    injective: bool  # true if no two triangles overlap


def flatten(
    points: FloatArray,
    faces: IntArray,
    start: FloatArray | None = None,
    *,
    n_iterations: int = 50,
    accuracy: float = 1e-3,
    keep_apart: bool = False,
) -> Flat | None:
    """Flatten a patch with the least symmetric Dirichlet energy that its start leads to.

    `points` (n, 3) float64; `faces` (m, 3) int32: all with the same winding; `start` (n, 2)
    float64: a layout to start from, by default a circle; ignored if a triangle is flipped or has no
    area. `accuracy`: the iteration stops after a step that gains less than this share of the energy
    above 4; `keep_apart`: also stop each step before the boundary crosses itself. Returns None if
    the patch is not an oriented surface, or if it has no usable start and is no disk.

    Examples
    --------
    >>> bent = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1]], dtype=float)
    >>> flat = flatten(bent, np.array([[0, 1, 2], [0, 3, 1]], dtype=np.int32))
    >>> round(flat.energy, 6), round(flat.l2, 6), flat.injective
    (4.0, 1.0, True)
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    uvs = np.zeros((len(points), 2)) if start is None else np.array(start, dtype=np.float64)
    figures = np.empty(3)
    is_laid = core.flatten_patch(
        points, faces, start is not None, n_iterations, accuracy, keep_apart, uvs, figures
    )
    return _flat(uvs, figures) if is_laid else None


def measured(points: FloatArray, faces: IntArray, uvs: FloatArray) -> Flat | None:
    """Move a layout to the origin, give it its area in space, and measure it as `flatten` does.

    `points` (n, 3) float64; `faces` (m, 3) int32; `uvs` (n, 2) float64. Returns None if the patch
    is not an oriented surface, or if a triangle is flipped or has no area.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    uvs = np.array(uvs, dtype=np.float64, order="C")
    figures = np.empty(3)
    is_measured = core.measure_layout(points, faces, uvs, figures)
    return _flat(uvs, figures) if is_measured else None


def _flat(uvs: FloatArray, figures: FloatArray) -> Flat:
    l2, energy, injective = figures.tolist()
    return Flat(uvs=uvs, l2=l2, energy=energy, injective=bool(injective))
