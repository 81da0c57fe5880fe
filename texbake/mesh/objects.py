"""The objects of a mesh: models that a file keeps apart, such as two crates that touch.

The groups of a mesh are objects, parts of objects, or neither, which only the reader of its file
can tell; `Mesh.group_objects` says so. docs/reference/formats.md says which objects count as one.
Vertices at one place belong together if they are of one object and move alike.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.compose import face_fields
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, IntArray, Mesh, frozen
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows

# Cosine of the largest angle between faces across which a surface continues: 60 degrees.
_GOES_ON = 0.5

_known: WeakKeyDictionary[Mesh, IntArray | None] = WeakKeyDictionary()


def face_objects(mesh: Mesh) -> IntArray | None:
    """(F,) int32 object of each face, kept for each mesh; None if there is only one."""
    if mesh not in _known:
        of_faces = _face_objects(mesh)
        _known[mesh] = None if of_faces is None else frozen(of_faces)
    return _known[mesh]


def _face_objects(mesh: Mesh) -> IntArray | None:
    if mesh.face_groups is None or len(set(mesh.group_objects)) < 2:
        return None
    objects = np.unique(mesh.group_objects, return_inverse=True)[1].astype(np.int32)
    of_faces = objects[mesh.face_groups]
    if (of_faces == of_faces[0]).all():
        return None
    labels = np.arange(len(objects), dtype=np.int32)
    for one, other in _connected(mesh, of_faces).tolist():
        ends = labels[one], labels[other]
        labels[labels == max(ends)] = min(ends)
    of_faces = labels[of_faces]
    return None if (of_faces == of_faces[0]).all() else of_faces


def _connected(mesh: Mesh, of_faces: IntArray) -> IntArray:
    """(n, 2) pairs of objects that share a vertex, or whose surfaces continue in one another."""
    places = moving_alike(mesh, weld_rows(mesh.positions))[mesh.faces]
    objects = np.repeat(of_faces[:, None], 3, axis=1)
    shared, found = _seen_otherwise(mesh.faces, objects)
    at_border = np.zeros(mesh.n_vertices, np.bool_)
    at_border[places[_seen_otherwise(places, objects)[0]]] = True
    # Where one continues in the other, both ends of an edge are places of both.
    near = np.flatnonzero(at_border[places].sum(axis=1) >= 2)
    solid = (places[near] != np.roll(places[near], 1, axis=1)).all(axis=1)
    across = opposite_half_edges(places[near], solid=solid)
    first = np.flatnonzero(across >= 0)
    pairs = near[np.stack([first, across[first]]) // 3]
    pairs = pairs[:, of_faces[pairs[0]] < of_faces[pairs[1]]]
    corners = LocalFrame.around(mesh).to_local(mesh.positions)[mesh.faces[pairs]]
    sides = corners[:, :, 1:] - corners[:, :, :1]
    normals = np.cross(sides[:, :, 0], sides[:, :, 1])
    lengths = pm.norm(normals, axis=2)
    goes_on = pm.vecdot(normals[0], normals[1]) > _GOES_ON * lengths[0] * lengths[1]
    sharing = np.stack([objects[shared], found[shared]], axis=1)
    return np.unique(np.concatenate([sharing, of_faces[pairs[:, goes_on]].T]), axis=0)


def _seen_otherwise(rows: IntArray, objects: IntArray) -> tuple[BoolArray, IntArray]:
    """(F, 3) bool: corners whose row is another object's as well; and (F, 3) one of its objects."""
    last = np.empty(int(rows.max()) + 1, np.int32)
    last[rows] = objects
    found = last[rows]
    return found != objects, found


def separate_objects(mesh: Mesh) -> IntArray | None:
    """(F,) int32: object of each face; None if there is only one, or if two share a vertex."""
    if mesh.face_groups is None or len(set(mesh.group_objects)) < 2:
        return None
    of_faces = np.array(mesh.group_objects, np.int32)[mesh.face_groups]
    objects = np.repeat(of_faces[:, None], 3, axis=1)
    if (of_faces == of_faces[0]).all() or _seen_otherwise(mesh.faces, objects)[0].any():
        return None
    return of_faces


def vertex_objects(mesh: Mesh) -> IntArray | None:
    """(V,) int32: object of each vertex, -1 for one that no face uses; None as `face_objects`."""
    of_faces = face_objects(mesh)
    if of_faces is None:
        return None
    found = np.full(mesh.n_vertices, -1, np.int32)
    found[mesh.faces] = of_faces[:, None]
    return found


def weld_vertices(mesh: Mesh, *, threads: int | None = None) -> IntArray:
    """(V,) int32: first vertex at the place of each that is of the same object; see `weld_rows`."""
    objects = vertex_objects(mesh)
    rows = mesh.positions
    if objects is not None:
        rows = np.concatenate([rows, objects[:, None].astype(np.float64)], axis=1)
    return moving_alike(mesh, weld_rows(rows, threads=threads))


def moving_alike(mesh: Mesh, firsts: IntArray) -> IntArray:
    """(V,) int32: first vertex of each, among those at its place that move alike."""
    again = np.flatnonzero(firsts != np.arange(len(firsts)))
    if mesh.deformation is None or len(again) == 0:
        return firsts
    chosen = np.unique(np.concatenate([again, firsts[again]]))
    rows = np.concatenate([firsts[chosen, None], mesh.deformation.rows(chosen)], axis=1)
    apart = firsts.copy()
    apart[chosen] = chosen[weld_rows(rows)]
    return apart


def joined_objects(mesh: Mesh) -> Mesh:
    """Return a mesh whose groups are not objects, so that all of it is one."""
    return mesh.replace(group_objects=()) if mesh.group_objects else mesh


def object_groups(mesh: Mesh) -> IntArray | None:
    """(F,) int32: first group of the object of each face; None as `face_objects`."""
    of_faces = face_objects(mesh)
    if of_faces is None or mesh.face_groups is None:
        return None
    firsts = np.full(int(of_faces.max()) + 1, len(mesh.group_names), np.int32)
    np.minimum.at(firsts, of_faces, mesh.face_groups)
    return np.asarray(firsts[of_faces])


def has_borders(mesh: Mesh) -> bool:
    """Whether an object has several groups."""
    if mesh.face_groups is None or len(mesh.group_names) < 2:
        return False
    groups = object_groups(mesh)
    return groups is None or not np.array_equal(groups, mesh.face_groups)


def without_borders(mesh: Mesh) -> Mesh:
    """Return a mesh with one group per object, its first; without groups if it is one object."""
    groups = object_groups(mesh)
    if groups is None:
        return mesh.replace(face_groups=None, group_names=())
    return mesh.replace(face_groups=groups)


def object_names(mesh: Mesh) -> tuple[str, ...]:
    """Name of the object of each group: what the names of its groups begin with, or their own."""
    if not mesh.group_objects:
        return mesh.group_names
    groups: dict[int, list[str]] = {}
    for number, name in zip(mesh.group_objects, mesh.group_names, strict=True):
        groups.setdefault(number, []).append(name)
    names = {number: _common_name(of_object) for number, of_object in groups.items()}
    return tuple(names[number] for number in mesh.group_objects)


def one_group_a_node(mesh: Mesh) -> Mesh:
    """Return a mesh whose groups are the nodes of its file, where these are objects."""
    if not mesh.group_objects or mesh.face_groups is None:
        return without_borders(mesh)
    names = dict(zip(mesh.group_objects, object_names(mesh), strict=True))
    numbers = sorted(names)
    groups = np.searchsorted(numbers, np.array(mesh.group_objects)[mesh.face_groups])
    return mesh.replace(
        face_groups=groups.astype(np.int32),
        group_names=tuple(names[number] for number in numbers),
        group_objects=tuple(numbers),
    )


def _common_name(names: list[str]) -> str:
    """Return what comes before the `/material` or ` number` of the groups of an object."""
    if len(names) == 1:
        return names[0]
    heads = {name.partition("/")[0] for name in names}
    if len(heads) > 1:  # primitives of a glTF mesh
        heads = {name.rpartition(" ")[0] for name in names}
    return (len(heads) == 1 and heads.pop()) or names[0]


def object_by_object(mesh: Mesh) -> Mesh:
    """Order faces by object: Blender reads a name that an OBJ file repeats as another object."""
    if not mesh.group_objects or mesh.face_groups is None:
        return mesh
    order = np.lexsort([mesh.face_groups, np.array(mesh.group_objects)[mesh.face_groups]])
    return mesh.replace(**face_fields(mesh, order))
