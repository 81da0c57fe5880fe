"""Areas of triangles, in space and in texture space."""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import FloatArray


def signed_areas(corners: FloatArray) -> FloatArray:
    """Area of each triangle in texture space, negative where it is mirrored.

    Parameters
    ----------
    corners : (F, 3, 2) float64
        Texture coordinates of the corners.

    Returns
    -------
    (F,) float64
        In units of the unit square; 0 for a triangle without area.

    Examples
    --------
    >>> signed_areas(np.array([[[0, 0], [1, 0], [0, 1]], [[0, 0], [0, 1], [1, 0]]], dtype=float))
    array([ 0.5, -0.5])
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0)


def surface_areas(corners: FloatArray) -> FloatArray:
    """Area of each triangle in space.

    Parameters
    ----------
    corners : (F, 3, 3) float64
        Positions of the corners.

    Returns
    -------
    (F,) float64
        0 for a triangle without area.
    """
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(crosses, axis=1) / 2.0)
