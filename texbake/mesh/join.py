"""Several meshes as one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from texbake.mesh.mesh import IntArray, Mesh


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes into one, each as a group of its own, named as the mesh.

    Parameters
    ----------
    meshes : sequence of Mesh
        At least one.

    Returns
    -------
    Mesh
        Positions and faces of all, in their order, with the texture coordinates and normals if
        every mesh has them. A single mesh comes back as it is.
    """
    if len(meshes) == 1:
        return meshes[0]
    fields: dict[str, Any] = {}
    for values, corners in (
        ("positions", "faces"),
        ("uvs", "uv_faces"),
        ("normals", "normal_faces"),
    ):
        parts = [getattr(mesh, values) for mesh in meshes]
        if any(part is None for part in parts):
            continue
        fields[values] = np.concatenate(parts)
        fields[corners] = offset_joined(
            [(getattr(mesh, corners), len(part)) for mesh, part in zip(meshes, parts, strict=True)]
        )
    counts = [mesh.n_faces for mesh in meshes]
    return Mesh(
        face_groups=np.repeat(np.arange(len(meshes), dtype=np.int32), counts),
        group_names=tuple(mesh.name for mesh in meshes),
        name=f"{len(meshes)} meshes",
        **fields,
    )


def offset_joined(parts: Sequence[tuple[IntArray, int]]) -> IntArray:
    """Index arrays joined, each moved on by the lengths of what those before it index."""
    offsets = np.cumsum([0] + [length for _, length in parts])[:-1]
    moved = [part + offset for (part, _), offset in zip(parts, offsets, strict=True)]
    return np.concatenate(moved).astype(np.int32)
