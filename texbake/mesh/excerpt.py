"""Some of a mesh's faces as a mesh of its own, with only the rows that they use."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import IntArray, Mesh


def excerpt(mesh: Mesh, chosen: npt.NDArray[np.bool_]) -> Mesh:
    """Mesh of some faces; rows of all arrays keep their order.

    Parameters
    ----------
    chosen : (F,) bool
        At least one.

    Returns
    -------
    Mesh
        The names of its groups are those of the whole. The mesh itself if all faces are chosen.
    """
    if chosen.all():
        return mesh
    vertices, faces = used_rows(mesh.faces[chosen], mesh.n_vertices)
    changes: dict[str, Any] = {"positions": mesh.positions[vertices], "faces": faces}
    for values, corners in (("uvs", "uv_faces"), ("normals", "normal_faces")):
        rows, indices = getattr(mesh, values), getattr(mesh, corners)
        if rows is not None:
            used, changes[corners] = used_rows(indices[chosen], len(rows))
            changes[values] = rows[used]
    for by_face in "tangents", "face_groups":
        array = getattr(mesh, by_face)
        changes[by_face] = None if array is None else array[chosen]
    if mesh.colors is not None:
        changes["colors"] = mesh.colors[vertices]
    return mesh.replace(**changes)


def used_rows(corners: IntArray, n_rows: int) -> tuple[npt.NDArray[np.intp], IntArray]:
    """Rows that corners index, in order, and the corners as indices into those."""
    used = np.zeros(n_rows, dtype=np.bool_)
    used[corners.ravel()] = True
    numbers = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(used), numbers[corners]
