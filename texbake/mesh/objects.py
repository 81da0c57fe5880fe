"""The objects of a mesh: models that a file keeps apart, such as two crates that touch.

The groups of a mesh are objects, parts of objects, or neither, which only the reader of its file
can tell; `Mesh.group_objects` says so. An object of two materials has two groups. Where faces of
two objects use the same vertex, the file does not keep them apart, and they count as one object.

Vertices at one place belong together if they are of one object. So objects that touch have normals,
ray directions and ray distances of their own.
"""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.weld import weld_rows


def vertex_objects(mesh: Mesh) -> IntArray | None:
    """(V,) int32: object of each vertex, -1 for one that no face uses.

    None where all faces are of one object, or the groups of the mesh are not objects.
    """
    if mesh.face_groups is None or len(set(mesh.group_objects)) < 2:
        return None
    objects = np.unique(mesh.group_objects, return_inverse=True)[1].astype(np.int32)
    of_faces = np.broadcast_to(objects[mesh.face_groups][:, None], mesh.faces.shape)
    found = np.full(mesh.n_vertices, -1, np.int32)
    found[mesh.faces] = of_faces
    differ = found[mesh.faces] != of_faces
    labels = np.arange(len(objects), dtype=np.int32)
    pairs = np.stack([found[mesh.faces][differ], of_faces[differ]], axis=1)
    for one, other in labels[np.unique(pairs, axis=0)].tolist():
        ends = labels[one], labels[other]
        labels[labels == max(ends)] = min(ends)
    found = np.where(found < 0, np.int32(-1), labels[found])
    used = found[found >= 0]
    return None if (used == used[0]).all() else found


def weld_vertices(mesh: Mesh, *, threads: int | None = None) -> IntArray:
    """(V,) int32: first vertex at the place of each that is of the same object; see `weld_rows`."""
    objects = vertex_objects(mesh)
    rows = mesh.positions
    if objects is not None:
        rows = np.concatenate([rows, objects[:, None].astype(np.float64)], axis=1)
    return weld_rows(rows, threads=threads)


def joined_objects(mesh: Mesh) -> Mesh:
    """Return a mesh whose groups are not objects, so that all of it is one."""
    return mesh.replace(group_objects=()) if mesh.group_objects else mesh


def object_names(mesh: Mesh) -> tuple[str, ...]:
    """Name of the object of each group: what the names of its groups begin with, or their own.

    Examples
    --------
    >>> mesh = Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]],
    ...     face_groups=[0], group_names=("lid 0", "lid 1", "box"), group_objects=(0, 0, 1))
    >>> object_names(mesh)
    ('lid', 'lid', 'box')
    """
    if not mesh.group_objects:
        return mesh.group_names
    groups: dict[int, list[str]] = {}
    for number, name in zip(mesh.group_objects, mesh.group_names, strict=True):
        groups.setdefault(number, []).append(name)
    names = {number: _common_name(of_object) for number, of_object in groups.items()}
    return tuple(names[number] for number in mesh.group_objects)


def _common_name(names: list[str]) -> str:
    """Return what comes before the `/material` or ` number` of the groups of an object."""
    if len(names) == 1:
        return names[0]
    heads = {name.partition("/")[0] for name in names}
    if len(heads) > 1:  # primitives of a glTF mesh
        heads = {name.rpartition(" ")[0] for name in names}
    return (len(heads) == 1 and heads.pop()) or names[0]
