"""The dense meshes of an asset, numbered throughout, and some of their parts as one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.parts.pieces import Piece
from texbake.errors import OptionError
from texbake.mesh.compose import excerpt, join_meshes
from texbake.mesh.materials import BaseColor, Materials
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.normals import shading_normals

BoolArray = npt.NDArray[np.bool_]


class DenseMeshes:
    """Several dense meshes with groups and materials numbered throughout.

    Parameters
    ----------
    meshes : sequence of Mesh
    materials : sequence of Materials or None
        One for each mesh, where anything is known of them.

    Attributes
    ----------
    meshes : list of Mesh
    materials : list of Materials or None
    """

    def __init__(
        self, meshes: Sequence[Mesh], materials: Sequence[Materials | None] | None = None
    ) -> None:
        self.meshes, self._first_groups = _with_common_groups(meshes)
        several = len(meshes) > 1
        self.materials = _with_common_names(meshes, materials or [None] * len(meshes), several)

    def joined(self, pieces: Sequence[Piece]) -> tuple[Mesh, Materials | None]:
        """Put parts into one mesh, in their order.

        Where only some of them have normals, coordinates or colors, the others get their shading
        normals, (0, 0) or white.
        """
        meshes, face_materials = [], []
        for piece in pieces:
            mesh, materials = self.meshes[piece.mesh], self.materials[piece.mesh]
            chosen = piece.faces_of(mesh, self._first_groups[piece.mesh])
            meshes.append(excerpt(mesh, chosen))
            if materials is not None:
                face_materials.append(materials.face_materials[chosen])
        known = self.materials[0]
        if known is None:
            return _join(meshes), None
        ids = np.concatenate(face_materials)
        return _join(meshes), Materials(
            face_materials=ids, names=known.names, base_colors=known.base_colors
        )

    def check_colors(self) -> None:
        """Raise `OptionError` where vertex colors of different meaning would be joined."""
        colored = [mesh.name for mesh in self.meshes if mesh.colors is not None]
        kinds = {name.lower().endswith((".glb", ".gltf")) for name in colored}
        if len(kinds) > 1:
            raise OptionError(
                "vertex-colors: those of glTF files are linear and those of the others are taken "
                "for sRGB; say what all of them are with --vertex-colors"
            )


def _with_common_groups(meshes: Sequence[Mesh]) -> tuple[list[Mesh], list[int]]:
    """Meshes whose groups are numbered throughout, a mesh without any being one; each's first."""
    if len(meshes) == 1:
        return list(meshes), [0]
    names: list[str] = []
    firsts = []
    for mesh in meshes:
        firsts.append(len(names))
        names += [mesh.name] if mesh.face_groups is None else mesh.group_names
    found = []
    for mesh, first in zip(meshes, firsts, strict=True):
        groups = mesh.face_groups
        ids: IntArray = np.zeros(mesh.n_faces, np.int32) if groups is None else groups
        numbered = (ids + first).astype(np.int32)
        found.append(mesh.replace(face_groups=numbered, group_names=tuple(names)))
    return found, firsts


def _with_common_names(
    meshes: Sequence[Mesh], materials: Sequence[Materials | None], several: bool
) -> list[Materials | None]:
    """Materials that are numbered throughout; a mesh without any has one without a color."""
    if not several or all(item is None for item in materials):
        return list(materials)
    names: list[str] = []
    colors: list[BaseColor | None] = []
    ids = []
    for mesh, item in zip(meshes, materials, strict=True):
        first = len(names)
        names += [mesh.name] if item is None else item.names
        # Images are told apart by their names, and each file may have an image 0.
        colors += [
            color and replace(color, image_name=f"{mesh.name}: {color.image_name}")
            for color in ([None] if item is None else item.base_colors)
        ]
        of_faces = np.zeros(mesh.n_faces, np.int32) if item is None else item.face_materials
        ids.append((of_faces + first).astype(np.int32))
    return [
        Materials(face_materials=part, names=tuple(names), base_colors=tuple(colors))
        for part in ids
    ]


def _join(meshes: list[Mesh]) -> Mesh:
    if len(meshes) == 1:
        return meshes[0]
    if any(mesh.normals is not None for mesh in meshes):
        meshes = [_with_normals(mesh) for mesh in meshes]
    if any(mesh.uvs is not None for mesh in meshes):
        meshes = [_with_uvs(mesh) for mesh in meshes]
    joined = join_meshes(meshes)
    changes: dict[str, Any] = {"name": ", ".join(dict.fromkeys(mesh.name for mesh in meshes))}
    if all(mesh.face_groups is not None for mesh in meshes):
        changes["face_groups"] = np.concatenate([mesh.face_groups for mesh in meshes])
        changes["group_names"] = meshes[0].group_names
    if any(mesh.colors is not None for mesh in meshes):
        changes["colors"] = np.concatenate([_colors(mesh) for mesh in meshes])
    return joined.replace(**changes)


def _with_normals(mesh: Mesh) -> Mesh:
    if mesh.normals is not None:
        return mesh
    normals, corners = shading_normals(mesh)
    return mesh.replace(normals=normals, normal_faces=corners)


def _with_uvs(mesh: Mesh) -> Mesh:
    if mesh.uvs is not None:
        return mesh
    return mesh.replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((mesh.n_faces, 3), np.int32))


def _colors(mesh: Mesh) -> npt.NDArray[np.float32]:
    """(V, 3) colors, white where there are none; alpha is no part of any map."""
    if mesh.colors is None:
        return np.ones((mesh.n_vertices, 3), np.float32)
    return mesh.colors[:, :3]
