"""What a classical mapping gives: coordinates for every corner, and what it met on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows


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
