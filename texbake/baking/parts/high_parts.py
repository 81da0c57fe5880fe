"""The high-poly meshes of an asset: their named parts, and some of the parts as one mesh.

A part is a group of a mesh, or a whole mesh. Groups and materials are numbered over all meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.parts.matching import Matching, PartsOptions, base_of, match_names, pair_names
from texbake.mesh.compose import excerpt, join_meshes, used_rows
from texbake.mesh.materials import Materials, MeshMaterial
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.objects import face_objects, object_names
from texbake.records import dataclass


@dataclass(frozen=True, eq=False)
class NamedPart:
    """Some faces of one mesh, under a name."""

    name: str  # of a group, or of a file without its suffix
    mesh: int  # index of the mesh
    groups: tuple[int, ...] | None = None  # groups of the mesh; None: all of its faces

    def faces_of(self, mesh: Mesh, first: int = 0) -> BoolArray:
        """(F,) bool: its faces of the mesh, whose groups may be numbered from `first` on."""
        if self.groups is None or mesh.face_groups is None:
            return np.ones(mesh.n_faces, dtype=np.bool_)
        is_in = np.zeros(len(mesh.group_names), dtype=np.bool_)
        is_in[np.array(self.groups, dtype=np.intp) + first] = True
        return is_in[mesh.face_groups]


def named_parts(meshes: Sequence[Mesh], suffix: str) -> list[NamedPart]:
    """Parts of meshes: groups of one name if any group has the suffix, else the mesh."""
    found = []
    for i, mesh in enumerate(meshes):
        is_gltf = mesh.name.lower().endswith((".glb", ".gltf"))
        names = [_of_object(name) if is_gltf else name for name in mesh.group_names]
        if mesh.face_groups is None or not any(base_of(name, suffix) for name in names):
            found.append(NamedPart(Path(mesh.name).stem, i))
            continue
        used = np.bincount(mesh.face_groups, minlength=len(names)).tolist()
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            if used[k]:
                groups.setdefault(name, []).append(k)
        found += [
            NamedPart(name, i, tuple(ids) if len(groups) > 1 else None)
            for name, ids in groups.items()
        ]
    return found


def named_objects(meshes: Sequence[Mesh]) -> list[NamedPart]:
    """Return the objects of meshes; nothing if the objects of a mesh are not apart."""
    found = []
    for i, mesh in enumerate(meshes):
        groups: dict[int, list[int]] = {}
        if mesh.face_groups is not None and mesh.group_objects:
            for group in np.unique(mesh.face_groups).tolist():
                groups.setdefault(mesh.group_objects[group], []).append(group)
        apart = face_objects(mesh)
        if apart is None or len(np.unique(apart)) < len(groups):
            return []
        names = object_names(mesh)
        found += [NamedPart(names[ids[0]], i, tuple(ids)) for ids in groups.values()]
    return found


def match_parts(
    high: Sequence[Mesh], low: Sequence[Mesh], parts: PartsOptions
) -> tuple[Matching, list[NamedPart], list[NamedPart]]:
    """Return which part would be baked from which, with the high-poly and low-poly parts."""
    highs = named_parts(high, parts.high_suffix)
    lows = named_parts(low, parts.low_suffix)
    names = [part.name for part in highs], [part.name for part in lows]
    return match_names(*names, parts), highs, lows


def match_objects(
    high: Sequence[Mesh], low: Sequence[Mesh], parts: PartsOptions
) -> tuple[Matching, list[NamedPart], list[NamedPart]] | None:
    """Which object would be baked from which; None if names or `parts` do not pair objects."""
    if parts.match_by_name or parts.join_objects:
        return None
    lows = named_objects(low)
    highs = named_objects(high) if lows else []
    matching = pair_names([part.name for part in highs], [part.name for part in lows], parts)
    return None if matching is None else (matching, highs, lows)


def _of_object(name: str) -> str:
    """Name of the object that a primitive belongs to."""
    start, _, number = name.rpartition(" ")
    return start if start and number.isdecimal() else name


class HighMeshes:
    """Several high-poly meshes whose groups and materials are numbered over all of them."""

    def __init__(
        self, meshes: Sequence[Mesh], materials: Sequence[Materials | None] | None = None
    ) -> None:
        self.meshes, self._first_groups = _with_common_groups(meshes)
        self.materials = _with_common_names(meshes, materials or [None] * len(meshes))

    def joined(self, parts: Sequence[NamedPart]) -> tuple[Mesh, Materials | None]:
        """Join parts into one mesh, in their order, with defaults for attributes that some lack."""
        meshes, of_parts = [], []
        for part in parts:
            mesh, materials = self.meshes[part.mesh], self.materials[part.mesh]
            chosen = part.faces_of(mesh, self._first_groups[part.mesh])
            meshes.append(excerpt(mesh, chosen))
            if materials is not None:
                of_parts.append(materials_of_faces(materials, mesh, chosen))
        return _join(meshes), _join_materials(of_parts, meshes) if of_parts else None


def _with_common_groups(meshes: Sequence[Mesh]) -> tuple[list[Mesh], list[int]]:
    """Meshes with groups numbered over all of them, and the first group of each mesh."""
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
    meshes: Sequence[Mesh], materials: Sequence[Materials | None]
) -> list[Materials | None]:
    """Materials numbered over all meshes; a mesh without any gets one without a color."""
    if len(meshes) == 1 or all(item is None for item in materials):
        return list(materials)
    found: list[MeshMaterial] = []
    ids = []
    for mesh, item in zip(meshes, materials, strict=True):
        first = len(found)
        if item is None:
            found.append(MeshMaterial(name=mesh.name))
        else:
            found += [_of_file(material, mesh.name) for material in item.materials]
        of_faces = np.zeros(mesh.n_faces, np.int32) if item is None else item.face_materials
        ids.append((of_faces + first).astype(np.int32))
    of_colored = [
        item is not None and item.has_vertex_colors
        for mesh, item in zip(meshes, materials, strict=True)
        if mesh.colors is not None
    ]
    has_colors = bool(of_colored) and all(of_colored)
    return [
        Materials(
            face_materials=part,
            materials=tuple(found),
            uv_sets={} if item is None else item.uv_sets,
            has_vertex_colors=has_colors,
        )
        for part, item in zip(ids, materials, strict=True)
    ]


def _of_file(material: MeshMaterial, file: str) -> MeshMaterial:
    """Material whose images are named after its file, since each file may have an image 0."""
    channels = {
        name: source
        if source.image is None
        else replace(source, image=replace(source.image, name=f"{file}: {source.image.name}"))
        for name, source in material.channels.items()
    }
    return replace(material, channels=channels)


def materials_of_faces(materials: Materials, mesh: Mesh, chosen: BoolArray) -> Materials:
    """Materials of the excerpt of some faces (F,)."""
    if chosen.all():
        return materials
    rows = np.zeros(0, np.intp)
    if materials.uv_sets and mesh.uvs is not None and mesh.uv_faces is not None:
        rows, _ = used_rows(mesh.uv_faces[chosen], len(mesh.uvs))
    return materials.of_faces(chosen, rows)


def _join_materials(parts: Sequence[Materials], meshes: Sequence[Mesh]) -> Materials:
    """Materials of meshes put into one; a part that lacks a set has (0, 0) in it."""
    n_rows = [1 if mesh.uvs is None else len(mesh.uvs) for mesh in meshes]
    sets = {
        number: np.concatenate(
            [
                part.uv_sets.get(number, np.zeros((n, 2)))
                for part, n in zip(parts, n_rows, strict=True)
            ]
        )
        for number in dict.fromkeys(number for part in parts for number in part.uv_sets)
    }
    ids = np.concatenate([part.face_materials for part in parts])
    return replace(parts[0], face_materials=ids, uv_sets=sets)


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


def _colors(mesh: Mesh) -> Float32Array:
    """(V, 3) colors, white if there are none; maps do not use alpha."""
    if mesh.colors is None:
        return np.ones((mesh.n_vertices, 3), np.float32)
    return mesh.colors[:, :3]
