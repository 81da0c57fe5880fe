"""Groups and colors of one mesh given to another, from the nearest points of its surface."""

from __future__ import annotations

import numpy as np

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.triangle_tree import TriangleTree


def with_nearest_attributes(light: Mesh, mesh: Mesh, threads: int | None = None) -> Mesh:
    """Give a mesh the groups and colors that it lacks and another has.

    Parameters
    ----------
    light
        The mesh to give to.
    mesh
        The mesh to take from, in the same space.
    threads
        None for every processor.

    Returns
    -------
    Mesh
        A face has the group of the point of `mesh` nearest to its center, a vertex the color
        there, interpolated between the corners.
    """
    groups = mesh.face_groups if light.face_groups is None else None
    colors = mesh.colors if light.colors is None else None
    if groups is not None and len(mesh.group_names) == 1:
        ids = np.zeros(light.n_faces, dtype=np.int32)
        light = light.replace(face_groups=ids, group_names=mesh.group_names)
        groups = None
    if groups is None and colors is None:
        return light
    frame = LocalFrame.around(mesh)
    tree = TriangleTree.build(frame.to_local(mesh.positions), mesh.faces, threads=threads)
    points = frame.to_local(light.positions)
    if groups is not None:
        centers = points[light.faces].mean(axis=1)
        _, nearest, _ = tree.closest_points(centers, threads=threads)
        light = light.replace(face_groups=groups[nearest], group_names=mesh.group_names)
    if colors is not None:
        _, nearest, weights = tree.closest_points(points, threads=threads)
        blended = np.einsum("nc,ncx->nx", weights, colors[mesh.faces[nearest]])
        light = light.replace(colors=blended)
    return light
