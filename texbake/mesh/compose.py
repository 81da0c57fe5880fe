"""Meshes made of other meshes: cut out, moved by an affine map, and flipped.

Under a map, normals follow by the inverse transpose and tangents as directions along the surface. A
map that mirrors turns triangles inside out; they are turned back by listing their corners in the
opposite order, and the sign of the bitangent changes, because the texture is mirrored on the
surface.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, UvSet
from texbake.mesh.weld import weld_rows

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


def excerpt(mesh: Mesh, chosen: npt.NDArray[np.bool_]) -> Mesh:
    """Mesh of some faces; rows of all arrays keep their order.

    `chosen` (F,) bool.
    """
    if chosen.all():
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
    return mesh.replace(**changes)


def used_rows(corners: IntArray, n_rows: int) -> tuple[npt.NDArray[np.intp], IntArray]:
    """Rows that corners index, in order, and the corners as indices into those."""
    used = np.zeros(n_rows, dtype=np.bool_)
    used[corners.ravel()] = True
    numbers = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(used), numbers[corners]


def split_vertices(mesh: Mesh) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], IntArray]:
    """Split vertices so that each has one texture coordinate and one normal.

    Returns `sources` (n,) int64: vertex of each new one: first those of the mesh, in their order,
    then copies; `corners` (n,) int64: a corner of each, -1 for those that no face uses; `faces` (F,
    3) int32.
    """
    used = np.full(mesh.n_vertices, -1)
    keys = [mesh.faces.ravel()]
    for values, ids in ((mesh.uvs, mesh.uv_faces), (mesh.normals, mesh.normal_faces)):
        if values is None or ids is None:
            continue
        used[keys[0]] = np.arange(mesh.faces.size)
        if not np.array_equal(ids.ravel()[used[mesh.faces]], ids):
            keys.append(weld_rows(values)[ids.ravel()])
    if len(keys) == 1:  # each vertex has the values of the last corner that uses it
        return np.arange(mesh.n_vertices), used, mesh.faces
    firsts = weld_rows(np.stack(keys, axis=1))
    places = np.flatnonzero(firsts == np.arange(len(firsts)))  # a corner of each new vertex
    vertices, of_vertex = np.unique(mesh.faces.ravel()[places], return_index=True)
    is_copy = np.ones(len(places), np.bool_)
    is_copy[of_vertex] = False
    copies = places[is_copy]
    corners: npt.NDArray[np.int64] = np.append(np.full(mesh.n_vertices, -1), copies)
    corners[vertices] = places[of_vertex]
    numbers = np.empty(len(firsts), np.int32)  # of the new vertex at its first corner
    numbers[corners[corners >= 0]] = np.flatnonzero(corners >= 0)
    rows: npt.NDArray[np.int64] = np.append(
        np.arange(mesh.n_vertices), mesh.faces.ravel()[copies]
    ).astype(np.int64)
    faces: IntArray = numbers[firsts].reshape(-1, 3)
    return rows, corners, faces


def values_of_vertices(
    values: npt.NDArray[Any], ids: IntArray, corners: npt.NDArray[np.int64]
) -> npt.NDArray[Any]:
    """(n, K) values of the `corners` that `split_vertices` returns; 0 where no face is."""
    by_vertex = values[ids.ravel()[corners]]
    by_vertex[corners < 0] = 0.0
    return by_vertex


# What float32 leaves of a unit vector, which stays as it is, bit for bit.
_UNIT = 1e-6


def transformed(mesh: Mesh, matrix: FloatArray) -> Mesh:
    """Move a mesh.

    `matrix` (4, 4) float64.
    """
    linear = np.asarray(matrix[:3, :3], np.float64)
    order = corner_order(linear)
    changes = changed_corners(mesh, lambda corners: corners[:, order])
    changes["positions"] = pm.matmul(mesh.positions, linear.T) + matrix[:3, 3]
    if mesh.normals is not None:
        changes["normals"] = transformed_normals(mesh.normals, linear)
    if mesh.tangents is not None:
        flat = mesh.tangents.reshape(-1, 4)
        turned = transformed_tangents(flat, linear).reshape(mesh.tangents.shape)
        changes["tangents"] = turned[:, order]
    changes["polygon_of"] = mesh.polygon_of
    return mesh.replace(**changes)


def is_mirroring(linear: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether a (3, 3) map turns a right hand into a left one; (...,) of (..., 3, 3) maps."""
    with np.errstate(divide="ignore"):  # a pivot that rounds to 0 is that of a flat map
        return np.asarray(pm.det(_moderate(linear)) < 0.0)


def corner_order(linear: FloatArray) -> slice:
    """Return the order in which the corners of a face are to be listed after a (3, 3) map."""
    return slice(None, None, -1) if is_mirroring(linear) else slice(None)


def normal_map(linear: FloatArray) -> FloatArray:
    """(..., 3, 3) maps of the normals of surfaces under (..., 3, 3) maps.

    They are inverse transposes up to a positive factor.
    """
    # Determinant times inverse transpose, which is defined also where the determinant is 0.
    scaled = _moderate(linear)
    cofactors = np.cross(scaled[..., [1, 2, 0], :], scaled[..., [2, 0, 1], :])
    return np.where(is_mirroring(linear), -1.0, 1.0)[..., None, None] * cofactors


def transformed_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """(N, 3) normals under a (3, 3) map."""
    return pm.matmul(normals, normal_map(linear).T)


def transformed_tangents(tangents: npt.NDArray[Any], linear: FloatArray) -> npt.NDArray[np.float32]:
    """(n, 4) tangents under a (3, 3) map: unit where they do not vanish, w 1 or -1."""
    signs = -1.0 if is_mirroring(linear) else 1.0
    return signed_tangents(pm.matmul(tangents[:, :3], linear.T), tangents[:, 3:], signs)


def signed_tangents(
    directions: FloatArray, w: npt.NDArray[Any], signs: float | FloatArray
) -> npt.NDArray[np.float32]:
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


def turned_over(mesh: Mesh, turned: npt.NDArray[np.bool_]) -> Mesh:
    """Return a mesh with some faces flipped, and the normals at their corners with them.

    Tangents are left out, since they belong to the old normals.

    `turned` (F,) bool.
    """
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
