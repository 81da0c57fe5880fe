"""Meshes far from the origin for their size, whose place float32 positions would not hold."""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import FloatArray, Mesh

# Distance from the origin, in diagonals, from which on float32 would lose more than 13 of its 24
# bits to it.
_FAR = 8192.0


def far_origin(mesh: Mesh) -> FloatArray:
    """(3,) place that a node is to carry: the origin, unless the mesh is far from it for its size.

    Positions of such a mesh are written about the place, so that float32 holds them.
    """
    bounds = mesh.bounds
    if np.abs(bounds).max() <= _FAR * mesh.diagonal:
        return np.zeros(3)
    center: FloatArray = (0.5 * bounds).sum(axis=0)
    return center
