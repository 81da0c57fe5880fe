"""Faces turned over, with everything at their corners."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import Mesh
from texbake.mesh.uv_sets import UvSet

# Fields of a mesh with a row of three indices for each face.
CORNERS = ("faces", "uv_faces", "normal_faces")


def turned_over(mesh: Mesh, turned: npt.NDArray[np.bool_]) -> Mesh:
    """Return a mesh with some faces turned over, and the normals at their corners with them.

    Tangents are left out, since they belong to the old normals.

    Parameters
    ----------
    mesh
    turned : (F,) bool
    """
    if not turned.any():
        return mesh
    changes: dict[str, Any] = {"tangents": None}
    for name in CORNERS:
        corners = getattr(mesh, name)
        if corners is not None:
            corners = corners.copy()
            corners[turned] = corners[turned][:, ::-1]
            changes[name] = corners
    changes["uv_sets"] = {
        name: UvSet(item.uvs, np.where(turned[:, None], item.faces[:, ::-1], item.faces))
        for name, item in mesh.uv_sets.items()
    }
    if mesh.normals is not None:
        corners = changes["normal_faces"].copy()
        corners[turned] += len(mesh.normals)
        changes["normals"] = np.concatenate([mesh.normals, -mesh.normals])
        changes["normal_faces"] = corners
    return mesh.replace(**changes)
