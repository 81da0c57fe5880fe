"""Meshes put into one, with their groups, and each moved to its place.

A map that mirrors turns triangles inside out; see `texbake.mesh.compose`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.compose import CORNERS, is_mirroring, normal_map, signed_tangents
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, UvSet, require_few_sets


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes into one, each as a group of its own, named as the mesh.

    Left out are colors, tangents, and texture coordinates or normals that not all of them have.
    """
    if len(meshes) == 1:
        return meshes[0]
    changes: dict[str, Any] = {"colors": None, "tangents": None, "group_objects": ()}
    for values, corners in (("uvs", "uv_faces"), ("normals", "normal_faces")):
        if any(getattr(mesh, values) is None for mesh in meshes):
            changes |= {values: None, corners: None}
    parts = [
        mesh.replace(
            face_groups=np.zeros(mesh.n_faces, np.int32), group_names=(mesh.name,), **changes
        )
        for mesh in meshes
    ]
    return join_parts(parts, f"{len(meshes)} meshes")


def _joined_polygons(meshes: Sequence[Mesh]) -> IntArray | None:
    """Polygon of each face of meshes put into one."""
    if all(mesh.polygon_of is None for mesh in meshes):
        return None
    parts: list[tuple[IntArray, int]] = []
    for mesh in meshes:
        own = mesh.polygon_of
        if own is None:
            own = np.arange(mesh.n_faces, dtype=np.int32)
        parts.append((own, mesh.n_polygons))
    return offset_joined(parts)


def offset_joined(parts: Sequence[tuple[IntArray, int]]) -> IntArray:
    """Index arrays joined, each offset by the lengths of what those before it index."""
    offsets = np.cumsum([0, *(length for _, length in parts[:-1])], dtype=np.int32)
    joined = np.concatenate([part for part, _ in parts]).astype(np.int32, copy=False)
    moves = np.repeat(offsets, [len(part) for part, _ in parts])
    joined += moves.reshape(-1, *[1] * (joined.ndim - 1))
    return joined


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A part of a mesh with the fields of `Mesh` but groups and name, not checked.

    Corners have one index for all attributes but positions and colors.
    """

    positions: FloatArray  # (V, 3) float64
    faces: IntArray  # (F, 3) int32; indices into `positions`, and into `colors`
    corners: IntArray  # (F, 3) int32; indices into all other attributes
    uvs: FloatArray | None  # (n, 2) float64
    normals: FloatArray | None  # (n, 3) float64
    tangents: FloatArray | None  # (n, 4) float64
    colors: npt.NDArray[np.float32] | None  # (V, 3) or (V, 4) float32; linear
    uv_sets: Mapping[str, UvSet] = field(default_factory=dict)

    @property
    def uv_faces(self) -> IntArray:
        """(F, 3) int32; indices into `uvs`."""
        return self.corners

    @property
    def normal_faces(self) -> IntArray:
        """(F, 3) int32; indices into `normals`."""
        return self.corners


Part = Mesh | MeshPart


def join_parts(
    parts: Sequence[Part],
    name: str,
    matrices: FloatArray | None = None,
    *,
    groups: Sequence[tuple[str, int]] | None = None,
) -> Mesh:
    """Put the parts of a file into one mesh, each moved by its matrix, of (n, 4, 4).

    If only some parts have texture coordinates or normals, the others get zeros, and if only some
    have colors, the others are white; tangents are kept if all have them. Each part keeps its
    groups and is an object of its own, unless `groups` has a name and an object for each part.
    """
    fields: dict[str, Any] = {
        "positions": np.concatenate([part.positions for part in parts]),
        "faces": offset_joined([(part.faces, len(part.positions)) for part in parts]),
    }
    for values, corners, width in (("uvs", "uv_faces", 2), ("normals", "normal_faces", 3)):
        arrays = [getattr(part, values) for part in parts]
        if all(array is None for array in arrays):
            continue
        zero = np.zeros((1, width))
        fields[values] = np.concatenate([zero if array is None else array for array in arrays])
        fields[corners] = offset_joined(
            [
                (0 * part.faces, 1) if array is None else (getattr(part, corners), len(array))
                for part, array in zip(parts, arrays, strict=True)
            ]
        )
    if len(parts) == 1 and isinstance(parts[0], Mesh):
        fields["colors"] = parts[0].colors  # may have no alpha
    elif any(part.colors is not None for part in parts):
        fields["colors"] = np.concatenate(
            [
                np.ones((len(part.positions), 4), np.float32)
                if part.colors is None
                else with_alpha(part.colors)
                for part in parts
            ]
        )
    fields["uv_sets"] = _joined_uv_sets(parts)
    # A matrix of huge numbers takes finite points to infinity, which `Mesh` refuses.
    with np.errstate(over="ignore", invalid="ignore"):
        if all(part.tangents is not None for part in parts):
            fields["tangents"] = _joined_tangents(parts, matrices)
        if matrices is not None:
            _place(fields, parts, matrices)
    return Mesh(
        **_joined_groups(parts, groups),
        name=name,
        **fields,
    )


def _joined_uv_sets(parts: Sequence[Part]) -> dict[str, UvSet]:
    """Sets of parts put into one; (0, 0) where only others have a set."""
    names = dict.fromkeys(name for part in parts for name in part.uv_sets)
    require_few_sets(len(names), f"{len(parts)} meshes")
    joined = {}
    for name in names:
        items = [
            part.uv_sets.get(name) or UvSet(np.zeros((1, 2)), 0 * part.faces) for part in parts
        ]
        faces = offset_joined([(item.faces, len(item.uvs)) for item in items])
        joined[name] = UvSet(np.concatenate([item.uvs for item in items]), faces)
    return joined


def _joined_groups(
    parts: Sequence[Part], groups: Sequence[tuple[str, int]] | None
) -> dict[str, Any]:
    """Fields of `Mesh` for groups and polygons; a mesh is one object unless it has several."""
    if groups is not None:
        names, objects = (list(column) for column in zip(*groups, strict=True))
        counts = [len(part.faces) for part in parts]
        face_groups = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    else:
        meshes = [part for part in parts if isinstance(part, Mesh)]
        names, objects, n_objects = [], [], 0
        for mesh in meshes:
            names += mesh.group_names
            own = mesh.group_objects or (0,) * len(mesh.group_names)
            objects += [n_objects + number for number in own]
            n_objects += max(own, default=0) + 1
        face_groups = offset_joined(
            [(mesh.face_groups, len(mesh.group_names)) for mesh in meshes]  # type: ignore[misc]
        )
    return {
        "face_groups": face_groups,
        "group_names": tuple(names),
        "group_objects": tuple(objects) if len(set(objects)) > 1 else (),
        "polygon_of": None if groups is not None else _joined_polygons(meshes),
    }


def _joined_tangents(parts: Sequence[Part], matrices: FloatArray | None) -> npt.NDArray[Any]:
    """(F, 3, 4) tangents of parts that all have some, each moved by its matrix."""
    found = [np.reshape(part.tangents, (-1, 4)) for part in parts]  # type: ignore[arg-type]
    rows, counts = np.concatenate(found), [len(part) for part in found]
    corners = [
        part.corners
        if isinstance(part, MeshPart)
        else np.arange(part.faces.size, dtype=np.int32).reshape(part.faces.shape)
        for part in parts
    ]
    if matrices is not None:
        directions = np.array(rows[:, :3], np.float64)
        _map(directions, counts, matrices[:, :3, :3])
        signs = np.where(is_mirroring(matrices[:, :3, :3]), -1.0, 1.0)
        rows = signed_tangents(directions, rows[:, 3:], np.repeat(signs, counts)[:, None])
    return rows[offset_joined(list(zip(corners, counts, strict=True)))]


def _place(fields: dict[str, Any], parts: Sequence[Part], matrices: FloatArray) -> None:
    """Move the positions and normals of joined parts, and flip the faces of mirrored ones."""
    linear = matrices[:, :3, :3]
    counts = [len(part.positions) for part in parts]
    _map(fields["positions"], counts, linear)
    fields["positions"] += np.repeat(matrices[:, :3, 3], counts, axis=0)
    if "normals" in fields:
        counts = [1 if part.normals is None else len(part.normals) for part in parts]
        _map(fields["normals"], counts, normal_map(linear))
        fields["normals"][np.repeat([part.normals is None for part in parts], counts)] = 0.0
    is_mirrored = is_mirroring(linear)
    if not is_mirrored.any():
        return
    flipped = np.repeat(is_mirrored, [len(part.faces) for part in parts])
    by_corner = [fields[name] for name in (*CORNERS, "tangents") if name in fields]
    for corners in (*by_corner, *(item.faces for item in fields["uv_sets"].values())):
        corners[flipped] = corners[flipped, ::-1]


_BATCH = 1 << 16  # rows moved at once


def _map(rows: FloatArray, counts: Sequence[int], maps: FloatArray) -> None:
    """Apply a (3, 3) map of each part to its rows, in place; equally long parts go together."""
    n_rows = np.array(counts)
    starts = np.cumsum(n_rows) - n_rows
    order = np.argsort(n_rows, kind="stable")
    for alike in np.split(order, np.flatnonzero(np.diff(n_rows[order])) + 1):
        count = int(n_rows[alike[0]])
        n_parts = max(_BATCH // max(count, 1), 1)
        for first in range(0, len(alike), n_parts):
            chosen = alike[first : first + n_parts]
            if n_parts == 1:
                part = rows[starts[chosen[0]] :][:count]
                part[:] = pm.matmul(part, maps[chosen[0]].T)
                continue
            at = starts[chosen, None] + np.arange(count)
            rows[at] = pm.matmul(rows[at], maps[chosen].swapaxes(1, 2))


def with_alpha(colors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(V, 4) colors of (V, 3) or (V, 4), opaque where they have no alpha."""
    rgba = np.ones((len(colors), 4), np.float32)
    rgba[:, : colors.shape[1]] = colors
    return rgba
