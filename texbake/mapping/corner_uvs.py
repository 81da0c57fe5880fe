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
        Counts of special cases by name, such as "faces touching a pole"; zeros are left out.
    """

    corners: FloatArray
    tallies: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        happened = {name: count for name, count in self.tallies.items() if count}
        object.__setattr__(self, "tallies", happened)


def with_coordinates(mesh: Mesh, corners: FloatArray) -> Mesh:
    """Give a mesh texture coordinates by corner.

    Corners of one vertex with equal coordinates share one entry.

    `corners` (F, 3, 2) float64. Returns Mesh: positions and faces are shared with `mesh`.
    """
    uvs, uv_faces = joined_corners(mesh.faces, corners)
    return mesh.replace(uvs=uvs, uv_faces=uv_faces, tangents=None)


def joined_corners(faces: IntArray, corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Weld the coordinates of corners that belong to the same vertex.

    `faces` (F, 3) int32; `corners` (F, 3, 2) float64. Returns `uvs` (T, 2) float64, `uv_faces` (F,
    3) int32.
    """
    flat = corners.reshape(-1, 2) + 0.0  # -0.0 becomes 0.0
    # Rows are welded by values of one type; a vertex index is exact as a float64.
    firsts = weld_rows(np.column_stack([faces.ravel(), flat]))
    used, uv_faces = np.unique(firsts, return_inverse=True)
    return flat[used], uv_faces.reshape(-1, 3).astype(np.int32)


def faces_of_group(mesh: Mesh, name: str) -> npt.NDArray[np.bool_]:
    """(F,) bool: the faces of a group."""
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
    """Mesh of the chosen faces; all vertices stay, used or not."""

    def kept(by_face: npt.NDArray[Any] | None) -> npt.NDArray[Any] | None:
        return None if by_face is None else by_face[chosen]

    return mesh.replace(
        faces=mesh.faces[chosen],
        uv_faces=kept(mesh.uv_faces),
        normal_faces=kept(mesh.normal_faces),
        tangents=kept(mesh.tangents),
        polygon_of=kept(mesh.polygon_of),
        face_groups=kept(mesh.face_groups),
    )


def with_selected_corners(
    mesh: Mesh, chosen: npt.NDArray[np.bool_], corners: FloatArray
) -> tuple[FloatArray, int]:
    """Corner coordinates of a whole mesh after some of its faces got new ones.

    `chosen` (F,) bool; `corners` (n, 3, 2) float64. Returns `corners` (F, 3, 2) float64.
    """
    has_uvs = mesh.uvs is not None
    whole = mesh.corner_uvs().copy() if has_uvs else np.zeros((mesh.n_faces, 3, 2))
    whole[chosen] = corners
    return whole, 0 if has_uvs else int(mesh.n_faces - chosen.sum())
