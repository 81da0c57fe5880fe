"""Objects that are the same in the spaces of their nodes, as instances of a mesh are.

Their corners lie at the same places but for rounding, in the same order, and look alike. Objects
that joints or morph targets bend are not compared.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Sequence

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.compose import corner_order, is_mirroring, normal_map, signed_tangents
from texbake.mesh.mesh import AnyArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.rig import Rig, inverse

# Difference of places as a share of the farthest, and of directions of length 1: a few roundings
# of float32.
_ROUNDING = 2.0**-20


def instances(mesh: Mesh, rig: Rig, ids: IntArray) -> list[list[int]]:
    """Return the objects of each kind with two objects or more, as `mesh` numbers them.

    `ids` (F,): faces with different ones look different.
    """
    if mesh.face_groups is None or not mesh.group_objects or not rig.fits(mesh):
        return []
    objects = np.array(mesh.group_objects)[mesh.face_groups]
    order = np.argsort(objects, kind="stable")
    numbers, starts = np.unique(objects[order], return_index=True)
    by_count: dict[int, list[tuple[int, IndexArray]]] = {}
    for number, faces in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
        by_count.setdefault(len(faces), []).append((number, faces))
    found: list[list[int]] = []
    for candidates in by_count.values():
        if candidates[1:]:
            found += _kinds(mesh, rig, ids, candidates)
    return sorted(kind for kind in found if kind[1:])


def _kinds(
    mesh: Mesh, rig: Rig, ids: IntArray, candidates: Sequence[tuple[int, IndexArray]]
) -> list[list[int]]:
    """Return the kinds among objects with equally many faces, each given by its faces."""
    kinds: list[tuple[FloatArray, list[int]]] = []
    # Of each kind of those that look alike: the sum of its coordinates, by which it is found.
    sums: dict[bytes, list[tuple[float, int]]] = {}
    for number, faces in candidates:
        item = rig.objects[number]
        to_node = inverse(item.matrix)
        if to_node is None or item.n_morphs or item.ignores_node or "skin" in rig.nodes[item.node]:
            continue
        turn = corner_order(to_node)
        rows = mesh.faces[faces][:, turn]
        exact: list[AnyArray] = [np.unique(rows, return_inverse=True)[1], ids[faces]]
        if mesh.uvs is not None and mesh.uv_faces is not None:
            exact.append(mesh.uvs[mesh.uv_faces[faces][:, turn]])
        exact += [each.uvs[each.faces[faces][:, turn]] for each in mesh.uv_sets.values()]
        if mesh.colors is not None:
            exact.append(mesh.colors[rows])
        alike = sums.setdefault(b"".join(each.tobytes() for each in exact), [])
        placed = _placed(mesh, faces, to_node, turn)
        sizes = np.abs(placed[:, :3])
        total, slack = float(sizes.sum()), 2.0 * _ROUNDING * sizes.size * float(sizes.max())
        start = bisect_left(alike, (total - slack, 0))
        near = alike[start : bisect_right(alike, (total + slack, len(kinds)))]
        for kind in sorted(kind for _, kind in near):
            if _is_same(kinds[kind][0], placed):
                kinds[kind][1].append(number)
                break
        else:
            insort(alike, (total, len(kinds)))
            kinds.append((placed, [number]))
    return [numbers for _, numbers in kinds]


def _is_same(known: FloatArray, placed: FloatArray) -> bool:
    limits = np.ones(known.shape[1])
    limits[:3] = np.abs(known[:, :3]).max()
    return bool((np.abs(known - placed).max(axis=0) <= _ROUNDING * limits).all())


def _placed(mesh: Mesh, faces: IndexArray, to_node: FloatArray, turn: slice) -> FloatArray:
    """(3 F, w) places, normals and tangents of corners in the space of a node."""
    linear = to_node[:3, :3]
    points = pm.matmul(mesh.positions[mesh.faces[faces][:, turn].ravel()], linear.T)
    points += to_node[:3, 3]
    columns = [points]
    if mesh.normals is not None and mesh.normal_faces is not None:
        normals = mesh.normals[mesh.normal_faces[faces][:, turn].ravel()]
        columns.append(_units(pm.matmul(normals, normal_map(linear).T)))
    if mesh.tangents is not None:
        tangents = mesh.tangents[faces][:, turn].reshape(-1, 4).astype(np.float64)
        sign = -1.0 if is_mirroring(linear) else 1.0
        moved = pm.matmul(tangents[:, :3], linear.T)
        columns.append(signed_tangents(moved, tangents[:, 3:], sign))
    return np.concatenate(columns, axis=1)


def _units(vectors: AnyArray) -> FloatArray:
    lengths = pm.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0))
