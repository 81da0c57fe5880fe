"""Meshes made of other meshes: cut out, moved by an affine map, flipped, and put into one.

Under a map, normals follow by the inverse transpose and tangents as directions along the surface. A
map that mirrors turns triangles inside out; they are turned back by listing their corners in the
opposite order, and the sign of the bitangent changes, because the texture is mirrored on the
surface.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.deformation import Deformation, joined_deformations
from texbake.mesh.mesh import (
    BoolArray,
    Float32Array,
    FloatArray,
    IntArray,
    Mesh,
    UvSet,
    require_few_sets,
)
from texbake.records import dataclass

# Fields of a mesh with a row of three indices for each face.
CORNERS = ("faces", "uv_faces", "normal_faces")


def changed_corners(mesh: Mesh, change: Callable[[IntArray], IntArray]) -> dict[str, Any]:
    """Return the fields of a mesh with a row of indices for each face, all changed alike."""
    rows = {name: getattr(mesh, name) for name in CORNERS}
    fields: dict[str, Any] = {name: change(row) for name, row in rows.items() if row is not None}
    sets = mesh.uv_sets.items()
    fields["uv_sets"] = {name: UvSet(item.uvs, change(item.faces)) for name, item in sets}
    return fields


def face_fields(mesh: Mesh, chosen: npt.NDArray[Any]) -> dict[str, Any]:
    """Return the fields of a mesh that have a row for each face, for some faces in some order."""
    fields = changed_corners(mesh, lambda corners: corners[chosen])
    for name in "tangents", "polygon_of", "face_groups":
        rows = getattr(mesh, name)
        fields[name] = None if rows is None else rows[chosen]
    return fields


def excerpt(mesh: Mesh, chosen: BoolArray | npt.NDArray[np.intp]) -> Mesh:
    """Mesh of the `chosen` (F,) faces, or of their numbers; rows of all arrays keep their order."""
    if chosen.dtype == np.bool_ and chosen.all():
        return mesh
    changes = face_fields(mesh, chosen)
    vertices, changes["faces"] = used_rows(changes["faces"], mesh.n_vertices)
    changes["positions"] = mesh.positions[vertices]
    for values, corners in (("uvs", "uv_faces"), ("normals", "normal_faces")):
        rows = getattr(mesh, values)
        if rows is not None:
            used, changes[corners] = used_rows(changes[corners], len(rows))
            changes[values] = rows[used]
    if mesh.colors is not None:
        changes["colors"] = mesh.colors[vertices]
    if mesh.deformation is not None:
        changes["deformation"] = mesh.deformation.of(vertices)
    return mesh.replace(**changes)


def used_rows(corners: IntArray, n_rows: int) -> tuple[npt.NDArray[np.intp], IntArray]:
    """Rows that corners index, in order, and the corners as indices into those."""
    if corners.size < n_rows // 16:  # sorting few takes less time than a mark for each row
        few = np.unique(corners)
        return few.astype(np.intp), np.searchsorted(few, corners).astype(np.int32)
    used = np.bincount(corners.ravel(), minlength=n_rows) > 0
    if used.all():
        return np.arange(n_rows), corners.astype(np.int32)
    numbers = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(used), numbers[corners]


# What float32 leaves of a unit vector, which stays as it is, bit for bit.
_UNIT = 1e-6


def transformed(mesh: Mesh, matrix: FloatArray) -> Mesh:
    """Move a mesh by a (4, 4) float64 matrix."""
    linear = np.asarray(matrix[:3, :3], np.float64)
    order = corner_order(linear)
    changes = changed_corners(mesh, lambda corners: corners[:, order])
    changes["positions"] = pm.matmul(mesh.positions, linear.T) + matrix[:3, 3]
    if mesh.normals is not None:
        changes["normals"] = transformed_normals(mesh.normals, linear)
    if mesh.tangents is not None:
        flat = mesh.tangents.reshape(-1, 4)
        signs = -1.0 if is_mirroring(linear) else 1.0
        moved = signed_tangents(pm.matmul(flat[:, :3], linear.T), flat[:, 3:], signs)
        changes["tangents"] = moved.reshape(mesh.tangents.shape)[:, order]
    changes["polygon_of"] = mesh.polygon_of
    if mesh.deformation is not None:
        changes["deformation"] = mesh.deformation.moved(linear)
    return mesh.replace(**changes)


def is_mirroring(linear: FloatArray) -> BoolArray:
    """Whether a (3, 3) map turns a right hand into a left one; (...,) of (..., 3, 3) maps."""
    with np.errstate(divide="ignore"):  # a pivot that rounds to 0 is that of a flat map
        return np.asarray(pm.det(_moderate(linear)) < 0.0)


def corner_order(linear: FloatArray) -> slice:
    """Return the order in which the corners of a face are to be listed after a (3, 3) map."""
    return slice(None, None, -1) if is_mirroring(linear) else slice(None)


def normal_map(linear: FloatArray) -> FloatArray:
    """(..., 3, 3) maps of normals: inverse transposes of `linear`, up to a positive factor."""
    # Determinant times inverse transpose, which is defined also where the determinant is 0.
    scaled = _moderate(linear)
    cofactors = np.cross(scaled[..., [1, 2, 0], :], scaled[..., [2, 0, 1], :])
    return np.where(is_mirroring(linear), -1.0, 1.0)[..., None, None] * cofactors


def transformed_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """(N, 3) normals under a (3, 3) map."""
    return pm.matmul(normals, normal_map(linear).T)


def signed_tangents(
    directions: FloatArray, w: npt.NDArray[Any], signs: float | FloatArray
) -> Float32Array:
    """(n, 4) tangents, unit where they do not vanish, w 1 or -1.

    `directions` (n, 3) float64, changed in place; `w` (n, 1): signs of the bitangents; `signs` (n,
    1) or float: -1 where the texture is mirrored on the surface.
    """
    lengths = pm.norm(directions, axis=1, keepdims=True)
    scaled = (np.abs(lengths - 1.0) > _UNIT) & (lengths > 0.0)
    directions = np.divide(directions, lengths, out=directions, where=scaled)
    return np.concatenate([directions, np.where(w < 0.0, -1.0, 1.0) * signs], axis=1).astype(
        np.float32
    )


def _moderate(linear: FloatArray) -> FloatArray:
    """Return maps, up to positive factors, with products that neither overflow nor vanish."""
    largest = np.abs(linear).max(axis=(-2, -1), keepdims=True)
    is_moderate = (largest == 0.0) | ((largest > 1e-100) & (largest < 1e100))
    return linear / np.where(is_moderate, 1.0, largest)


def turned_over(mesh: Mesh, turned: BoolArray) -> Mesh:
    """Flip some faces (F,) and the normals at their corners, and drop tangents."""
    if not turned.any():
        return mesh
    changes = changed_corners(
        mesh, lambda corners: np.where(turned[:, None], corners[:, ::-1], corners)
    )
    changes |= {"tangents": None, "polygon_of": mesh.polygon_of}
    if mesh.normals is not None:
        changes["normals"] = np.concatenate([mesh.normals, -mesh.normals])
        changes["normal_faces"][turned] += len(mesh.normals)
    return mesh.replace(**changes)


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes as groups of their names; drop colors, tangents, uvs and normals not in all."""
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


def offset_joined(parts: Sequence[tuple[IntArray, int]]) -> IntArray:
    """Index arrays joined, each offset by the lengths of what those before it index."""
    offsets = np.cumsum([0, *(length for _, length in parts[:-1])], dtype=np.int32)
    joined = np.concatenate([part for part, _ in parts]).astype(np.int32, copy=False)
    moves = np.repeat(offsets, [len(part) for part, _ in parts])
    joined += moves.reshape(-1, *[1] * (joined.ndim - 1))
    return joined


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A part of a mesh, not checked; corners have one index for all but positions and colors."""

    positions: FloatArray  # (V, 3) float64
    faces: IntArray  # (F, 3) int32; indices into `positions`, and into `colors`
    corners: IntArray  # (F, 3) int32; indices into all other attributes
    uvs: FloatArray | None  # (n, 2) float64
    normals: FloatArray | None  # (n, 3) float64
    tangents: FloatArray | None  # (n, 4) float64
    colors: Float32Array | None  # (V, 3) or (V, 4) float32; linear
    uv_sets: Mapping[str, UvSet] = field(default_factory=dict)
    deformation: Deformation | None = None  # of the positions

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
    objects: Sequence[int] | None = None,
) -> Mesh:
    """Put the parts of a file into one mesh, each moved by its matrix, of (n, 4, 4).

    If only some parts have texture coordinates or normals, the others get zeros, and if only some
    have colors, the others are white; tangents are kept if all have them. Each part keeps its
    groups and is an object of its own, unless `groups` has a name and an object for each part, or
    `objects` the first object of each.
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
    fields["deformation"] = _joined_deformation(parts, matrices)
    # A matrix of huge numbers takes finite points to infinity, which `Mesh` refuses.
    with np.errstate(over="ignore", invalid="ignore"):
        if all(part.tangents is not None for part in parts):
            fields["tangents"] = _joined_tangents(parts, matrices)
        if matrices is not None:
            _place(fields, parts, matrices)
    return Mesh(**_joined_groups(parts, groups, objects), name=name, **fields)


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


def _joined_deformation(parts: Sequence[Part], matrices: FloatArray | None) -> Deformation | None:
    """Deformation of joined parts, each transformed by its matrix."""
    found = [part.deformation for part in parts]
    if matrices is not None:
        found = [
            deformation and deformation.moved(matrix[:3, :3])
            for deformation, matrix in zip(found, matrices, strict=True)
        ]
    counts = [len(part.positions) for part in parts]
    return joined_deformations(list(zip(found, counts, strict=True)))


def _joined_groups(
    parts: Sequence[Part], groups: Sequence[tuple[str, int]] | None, numbers: Sequence[int] | None
) -> dict[str, Any]:
    """Fields of `Mesh` for groups and polygons; a mesh is one object unless it has several."""
    polygon_of = None
    if groups is not None:
        names, objects = (list(column) for column in zip(*groups, strict=True))
        counts = [len(part.faces) for part in parts]
        face_groups = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    else:
        meshes = [part for part in parts if isinstance(part, Mesh)]
        if any(mesh.polygon_of is not None for mesh in meshes):
            polygon_of = offset_joined([(mesh.polygon_numbers, mesh.n_polygons) for mesh in meshes])
        names, objects, n_objects = [], [], 0
        for i, mesh in enumerate(meshes):
            names += mesh.group_names
            n_objects = n_objects if numbers is None else numbers[i]
            own = mesh.group_objects or (0,) * len(mesh.group_names)
            objects += [n_objects + number for number in own]
            n_objects += max(own, default=0) + 1
        face_groups = offset_joined(
            [(mesh.face_groups, len(mesh.group_names)) for mesh in meshes]  # type: ignore[misc]
        )
    return {
        "face_groups": face_groups,
        "group_names": tuple(names),
        "group_objects": tuple(objects) if set(objects) - {0} else (),
        "polygon_of": polygon_of,
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


def with_alpha(colors: Float32Array) -> Float32Array:
    """(V, 4) colors of (V, 3) or (V, 4), opaque where they have no alpha."""
    rgba = np.ones((len(colors), 4), np.float32)
    rgba[:, : colors.shape[1]] = colors
    return rgba
