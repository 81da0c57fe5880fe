"""One group of a mesh's faces, and coordinates for it alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Mesh

_NAMES_SHOWN = 8


def faces_of_group(mesh: Mesh, name: str) -> npt.NDArray[np.bool_]:
    """(F,) bool: the faces of a group.

    Raises
    ------
    OptionError
        The mesh has no such group, or no face is in it.
    """
    if not mesh.group_names or mesh.face_groups is None:
        raise OptionError(f"only: {mesh.name} has no groups, so none is named {name}")
    ids = [i for i, known in enumerate(mesh.group_names) if known == name]
    chosen = np.isin(mesh.face_groups, ids)
    if not chosen.any():
        names = ", ".join(mesh.group_names[:_NAMES_SHOWN])
        more = ", ..." if len(mesh.group_names) > _NAMES_SHOWN else ""
        raise OptionError(f"only: {mesh.name} has no faces in a group {name}; it has {names}{more}")
    return chosen


def selected(mesh: Mesh, chosen: npt.NDArray[np.bool_]) -> Mesh:
    """Mesh of some of the faces; points that none of them uses stay where they are."""

    def kept(by_face: npt.NDArray[Any] | None) -> npt.NDArray[Any] | None:
        return None if by_face is None else by_face[chosen]

    return mesh.replace(
        faces=mesh.faces[chosen],
        uv_faces=kept(mesh.uv_faces),
        normal_faces=kept(mesh.normal_faces),
        tangents=kept(mesh.tangents),
        face_groups=kept(mesh.face_groups),
    )


def with_selected_corners(
    mesh: Mesh, chosen: npt.NDArray[np.bool_], corners: FloatArray
) -> tuple[FloatArray, int]:
    """Corner coordinates of a whole mesh, of which some faces have got new ones.

    Parameters
    ----------
    mesh : Mesh
        Its own coordinates stay for the other faces; where it has none, these get (0, 0).
    chosen : (F,) bool
    corners : (n, 3, 2) float64
        Of the chosen faces.

    Returns
    -------
    corners : (F, 3, 2) float64
    n_without : int
        Other faces that have no coordinates.
    """
    has_uvs = mesh.uvs is not None
    whole = mesh.corner_uvs().copy() if has_uvs else np.zeros((mesh.n_faces, 3, 2))
    whole[chosen] = corners
    return whole, 0 if has_uvs else int(mesh.n_faces - chosen.sum())
