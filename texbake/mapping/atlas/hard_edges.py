"""Regions of a surface between its hard edges, so that charts end at these edges.

Across a hard edge the normals of a mesh jump. A normal map can hold no such jump within a chart:
texels next to the edge would blend both sides.
"""

from __future__ import annotations

import numpy as np

from texbake.mapping.seams import merged_labels
from texbake.mesh.hard_edges import exceed_angle, inner_edges, normals_jump
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.normals import face_normals


def regions_between(
    mesh: Mesh, *, hard_edges: bool, angle: float | None, regions: IntArray | None = None
) -> tuple[IntArray | None, int]:
    """Divide a surface at its hard edges.

    `regions` (F,) int32. Returns `regions` (F,) int32 or None: those given, if there is nothing to
    divide at.
    """
    if angle is None and not (hard_edges and mesh.normals is not None):
        return regions, 0
    one, other = inner_edges(mesh, regions)
    divides = np.zeros(len(one), dtype=np.bool_)
    if hard_edges and mesh.normals is not None:
        divides |= normals_jump(mesh, one, other)
    if angle is not None:
        normals = face_normals(mesh)
        divides |= exceed_angle(normals[one // 3], normals[other // 3], angle)
    labels = merged_labels(
        mesh.n_faces,
        (one[~divides] // 3).astype(np.int32),
        (other[~divides] // 3).astype(np.int32),
    )
    return labels, int(np.count_nonzero(divides & (labels[one // 3] == labels[other // 3])))
