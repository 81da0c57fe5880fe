"""A mesh under an affine map: its positions, and what must follow so that it looks as it did.

Normals follow by the inverse transpose, tangents as directions along the surface. A map that
mirrors turns triangles inside out; they are turned back by listing their corners the other way
round, and the sign of the bitangent changes, because the texture is mirrored on the surface.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, Mesh

# What float32 leaves of a unit vector, which stays as it is, bit for bit.
_UNIT = 1e-6


def transformed(mesh: Mesh, matrix: FloatArray) -> Mesh:
    """Move a mesh.

    Parameters
    ----------
    mesh : Mesh
    matrix : (4, 4) float64
        Affine; takes (x, y, z, 1) of the mesh to where it is to be.

    Returns
    -------
    Mesh
        Its faces are counter-clockwise seen from outside also where the map mirrors: then all
        corners of a face are listed in the other order, which `corner_order` tells.
    """
    linear = np.asarray(matrix[:3, :3], np.float64)
    order = corner_order(linear)
    changes: dict[str, Any] = {"positions": mesh.positions @ linear.T + matrix[:3, 3]}
    for corners in "faces", "uv_faces", "normal_faces":
        indices = getattr(mesh, corners)
        changes[corners] = None if indices is None else indices[:, order]
    if mesh.normals is not None:
        changes["normals"] = transformed_normals(mesh.normals, linear)
    if mesh.tangents is not None:
        flat = mesh.tangents.reshape(-1, 4)
        turned = transformed_tangents(flat, linear).reshape(mesh.tangents.shape)
        changes["tangents"] = turned[:, order]
    return mesh.replace(**changes)


def is_mirroring(linear: FloatArray) -> bool:
    """Whether a (3, 3) map turns a right hand into a left one."""
    return float(np.linalg.det(_moderate(linear))) < 0.0


def corner_order(linear: FloatArray) -> slice:
    """Return the order in which the corners of a face are to be listed after a (3, 3) map."""
    return slice(None, None, -1) if is_mirroring(linear) else slice(None)


def transformed_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """(N, 3) normals under a (3, 3) map, by its inverse transpose up to a positive factor."""
    # Determinant times inverse transpose, which is defined also where the determinant is 0.
    scaled = _moderate(linear)
    cofactors = np.cross(scaled[[1, 2, 0]], scaled[[2, 0, 1]])
    return normals @ ((-1.0 if is_mirroring(linear) else 1.0) * cofactors).T


def transformed_tangents(tangents: npt.NDArray[Any], linear: FloatArray) -> npt.NDArray[np.float32]:
    """(n, 4) tangents under a (3, 3) map: unit where they do not vanish, w 1 or -1."""
    directions = tangents[:, :3] @ linear.T
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    scaled = (np.abs(lengths - 1.0) > _UNIT) & (lengths > 0.0)
    directions = np.divide(directions, lengths, out=directions, where=scaled)
    # w is the sign of the bitangent; what rounds to neither is no tangent space, and counts as 1.
    signs = np.where(tangents[:, 3:] < 0.0, -1.0, 1.0) * (-1.0 if is_mirroring(linear) else 1.0)
    return np.concatenate([directions, signs], axis=1).astype(np.float32)


def _moderate(linear: FloatArray) -> FloatArray:
    """Return the map, up to a positive factor, with products that neither overflow nor vanish."""
    largest = float(np.abs(linear).max())
    return linear if largest == 0.0 or 1e-100 < largest < 1e100 else linear / largest
