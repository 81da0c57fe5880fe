"""Named parts of meshes: their groups, or a mesh as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.parts.matching import has_suffix
from texbake.mesh.mesh import Mesh

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Piece:
    """Some faces of one mesh, under a name.

    Attributes
    ----------
    name : str
        That of a group, or of a file without its suffix.
    mesh : int
        Place of the mesh.
    groups : tuple of int, optional
        Of the mesh; None: all of its faces.
    """

    name: str
    mesh: int
    groups: tuple[int, ...] | None = None

    def faces_of(self, mesh: Mesh, first: int = 0) -> BoolArray:
        """(F,) bool: its faces of the mesh, whose groups may have been numbered on by `first`."""
        if self.groups is None or mesh.face_groups is None:
            return np.ones(mesh.n_faces, dtype=np.bool_)
        is_in = np.zeros(len(mesh.group_names), dtype=np.bool_)
        is_in[np.array(self.groups, dtype=np.intp) + first] = True
        return is_in[mesh.face_groups]


def pieces_of(meshes: Sequence[Mesh], suffix: str) -> list[Piece]:
    """Named parts of meshes: groups where any of a mesh's has the suffix, else the mesh as a whole.

    Groups of one name are one part, and so are the primitives `NAME 0`, `NAME 1` that an object of
    a glTF file has become.
    """
    found = []
    for i, mesh in enumerate(meshes):
        is_gltf = mesh.name.lower().endswith((".glb", ".gltf"))
        names = [_of_object(name) if is_gltf else name for name in mesh.group_names]
        if mesh.face_groups is None or not any(has_suffix(name, suffix) for name in names):
            found.append(Piece(Path(mesh.name).stem, i))
            continue
        used = np.bincount(mesh.face_groups, minlength=len(names)).tolist()
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            if used[k]:
                groups.setdefault(name, []).append(k)
        found += [
            Piece(name, i, tuple(ids) if len(groups) > 1 else None) for name, ids in groups.items()
        ]
    return found


def _of_object(name: str) -> str:
    """Name of the object that a primitive, counted from 0 on, belongs to."""
    start, _, number = name.rpartition(" ")
    return start if start and number.isdecimal() else name
