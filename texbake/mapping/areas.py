"""Areas of triangles, in space and in texture space."""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import MeshError, UvError
from texbake.mesh.mesh import FloatArray, Mesh

# In model units or texture tiles. Its fourth power, the square of an area, is still finite.
_LONGEST = 1e75


def signed_areas(corners: FloatArray) -> FloatArray:
    """Area of each triangle in texture space, negative where it is mirrored.

    `corners` (F, 3, 2) float64. Returns (F,) float64, in units of the unit square; 0 for a triangle
    without area.

    Examples
    --------
    >>> signed_areas(np.array([[[0, 0], [1, 0], [0, 1]], [[0, 0], [0, 1], [1, 0]]], dtype=float))
    array([ 0.5, -0.5])
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0)


def surface_areas(corners: FloatArray) -> FloatArray:
    """Area of each triangle in space.

    `corners` (F, 3, 3) float64. Returns (F,) float64: 0 for a triangle without area.
    """
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(pm.norm(crosses, axis=1) / 2.0)


def unmeasurable_size(mesh: Mesh) -> tuple[float, float] | None:
    """Length and greatest coordinate of a mesh whose areas would leave the range of float64.

    None if areas, and their squares, stay within it.
    """
    with np.errstate(over="ignore"):
        low, high = mesh.bounds
        length = float((high - low).max())
        farthest = float(np.abs(mesh.bounds).max())
    if farthest > _LONGEST or 0.0 < length < 1.0 / _LONGEST:
        return length, farthest
    return None


def check_measurable(mesh: Mesh) -> None:
    """Raise `MeshError` if areas, or their squares, would leave the range of float64."""
    size = unmeasurable_size(mesh)
    if size is not None:
        length, farthest = size
        raise MeshError(
            f"{mesh.name}: it is {length:.3g} model units long and extends up to {farthest:.3g} "
            "from the origin, so its areas cannot be computed; scale it first"
        )


def has_measurable_uvs(mesh: Mesh) -> bool:
    """Whether areas in the texture, and their squares, stay within the range of float64."""
    return mesh.uvs is None or float(np.abs(mesh.corner_uvs()).max()) <= _LONGEST


def measurable_uvs(mesh: Mesh) -> FloatArray:
    """(F, 3, 2) float64: texture coordinates of the corners, checked so that areas are finite."""
    corners = mesh.corner_uvs()
    if not has_measurable_uvs(mesh):
        raise UvError(
            f"{mesh.name}: its texture coordinates lie up to {np.abs(corners).max():.3g} tiles "
            "from the origin, so areas in the texture cannot be computed; make new ones with: "
            f"texbake unwrap {mesh.name} -o OUT"
        )
    return corners
