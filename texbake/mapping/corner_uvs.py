"""Texture coordinates by face corner: what a mapping returns, and how a mesh stores them.

A mapping may cover one group of faces alone; the other faces then keep the coordinates they have.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows

_NAMES_SHOWN = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Projected:
    """Texture coordinates of the corners of faces.

    Attributes
    ----------
    corners : (F, 3, 2) float64
        (s, t) of each corner, finite.
    tallies : dict of str to int
        What was met, by its name, as in "faces at a pole": how many. What did not
        happen is left out.
    """

    corners: FloatArray
    tallies: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        happened = {name: count for name, count in self.tallies.items() if count}
        object.__setattr__(self, "tallies", happened)


def with_coordinates(mesh: Mesh, corners: FloatArray) -> Mesh:
    """Give a mesh coordinates by corner; corners of one vertex with equal coordinates share them.

    Parameters
    ----------
    mesh : Mesh
    corners : (F, 3, 2) float64

    Returns
    -------
    Mesh
        Positions and faces are shared with `mesh`; `uvs` come in the order in which faces first
        use them. Tangents that came with the mesh, made for other coordinates, are gone.
    """
    uvs, uv_faces = joined_corners(mesh.faces, corners)
    return mesh.replace(uvs=uvs, uv_faces=uv_faces, tangents=None)


def joined_corners(faces: IntArray, corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Coordinates without repeats, and indices into them, of corners of the same vertices.

    Parameters
    ----------
    faces : (F, 3) int32
        Vertices of the corners.
    corners : (F, 3, 2) float64

    Returns
    -------
    uvs : (T, 2) float64
    uv_faces : (F, 3) int32
    """
    flat = corners.reshape(-1, 2) + 0.0  # -0.0 becomes 0.0
    # A vertex as a float64 is exact, and three of one type are what rows are welded by.
    firsts = weld_rows(np.column_stack([faces.ravel(), flat]))
    used, uv_faces = np.unique(firsts, return_inverse=True)
    return flat[used], uv_faces.reshape(-1, 3).astype(np.int32)


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
