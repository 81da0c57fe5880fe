"""How far one has to go on a triangle: steps along its texture coordinates, or along itself.

Every step is told as what the weights of the triangle's second and third corner grow by, so that
anything that is linear over it, from positions to normals, follows by two products.

Based on: Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989.
"""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import FloatArray


def steps_along_texture(corner_uvs: FloatArray) -> FloatArray:
    """Growth of the weights for one more u, then for one more v.

    Parameters
    ----------
    corner_uvs : (F, 3, 2) float64

    Returns
    -------
    (F, 4) float64
        Of triangles without area on the texture, where (u, v) cannot be told apart, all 0.
    """
    along, up = corner_uvs[:, 1] - corner_uvs[:, 0], corner_uvs[:, 2] - corner_uvs[:, 0]
    area = along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0]
    inverse = np.stack([up[:, 1], -along[:, 1], -up[:, 0], along[:, 0]], axis=1)
    return _divided(inverse, area)


def steps_along_surface(corners: FloatArray) -> FloatArray:
    """Growth of the weights for one unit along the first edge, then for one across it.

    Parameters
    ----------
    corners : (F, 3, 3) float64
        Positions.

    Returns
    -------
    (F, 4) float64
        Across is counter-clockwise seen from the front. Of triangles without area all 0.
    """
    along, up = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(along, axis=1)
    area = np.linalg.norm(np.cross(along, up), axis=1)
    shift = np.einsum("ij,ij->i", along, up)
    # In the plane of the triangle its corners are (0, 0), (length, 0), (shift, area) / length.
    first = _divided(np.stack([np.ones_like(length), np.zeros_like(length)], axis=1), length)
    second = _divided(np.stack([-shift, length * length], axis=1), area * length)
    steps = np.concatenate([first, second], axis=1)
    return np.where((area > 0.0)[:, None], steps, 0.0)


def _divided(rows: FloatArray, by: FloatArray) -> FloatArray:
    """Rows over numbers; 0 where that is beyond float64."""
    with np.errstate(all="ignore"):
        quotients = rows / by[:, None]
    return np.where(np.isfinite(quotients).all(axis=1, keepdims=True), quotients, 0.0)
