"""A patch of triangles: its neighbors and boundary, and whether a layout of it overlaps itself.

A sparse matrix over the vertices of a patch has one row for each vertex: first the vertex itself,
then those that it shares an edge with. What is assembled from triangles finds its entries there.

Where no triangle is flipped, a point is covered as often as the boundary winds around it. So a
layout covers nothing twice if its boundary does not meet itself and only one of its loops runs
counter-clockwise. Where the boundary only touches itself, like the two sides of a closed slit, the
triangles decide, allowing for rounding.

Based on: Lipman, "Bijective Mappings of Meshes with Boundary and the Degree in Mesh Processing",
2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.mapping.kernels.face_graph import loops_kernel, neighbors_kernel
from texbake.mapping.kernels.planar_overlap import APART, CROSSING, TOUCH_DEPTH, boundary_meeting
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Triangles of a patch, and how they are connected.

    Attributes
    ----------
    faces : (m, 3) int32
        Indices of vertices below n.
    row_starts : (n + 1,) int32
        Entries of vertex i are `row_starts[i]` to `row_starts[i + 1] - 1`.
    columns : (k,) int32
        The vertex of each entry; the first of row i is i.
    entries : (m, 3, 3) int32
        Entry of row corner i and column corner j of each triangle.
    boundary : (b, 2) int32
        Edges of a single triangle, in its direction.
    boundary_loops : (b,) int32
        Loop of each of these edges; 0 for all if there are touching fans.
    loops : tuple of (l,) int32
        Boundary loops, each in the direction of its triangles; none if there are touching fans.
    has_touching_fans : bool
        True if more than one boundary edge leaves some vertex.
    is_disk : bool
        True if the patch is connected, and a disk once all its loops but one are filled.
    """

    faces: IntArray
    row_starts: IntArray
    columns: IntArray
    entries: IntArray
    boundary: IntArray
    boundary_loops: IntArray
    loops: tuple[IntArray, ...]
    has_touching_fans: bool
    is_disk: bool

    @property
    def n_vertices(self) -> int:
        """Number of vertices, including unused ones."""
        return len(self.row_starts) - 1


def patch_of(faces: IntArray, n_vertices: int) -> Patch | None:
    """Find the neighbors and the boundary of a patch.

    Parameters
    ----------
    faces : (m, 3) int32
    n_vertices : int

    Returns
    -------
    Patch or None
        None without triangles, and if it is not an oriented surface: an edge has more than two
        triangles, or two that run along it in one direction, or a triangle has a vertex twice.
    """
    if len(faces) == 0:
        return None
    faces = np.array(faces, dtype=np.int32, order="C")  # writable: one signature of the kernels
    row_starts, columns, entries, boundary, is_surface = neighbors_kernel(faces, n_vertices)
    if not is_surface:
        return None
    leaving = np.bincount(boundary[:, 0], minlength=n_vertices)
    touching = bool((leaving > 1).any())
    loops = () if touching else _loops(boundary, n_vertices)
    loop_ids = np.zeros(n_vertices, dtype=np.int32)
    for index, loop in enumerate(loops):
        loop_ids[loop] = index
    used = np.diff(row_starts) > 1
    n_edges = (len(columns) - n_vertices) // 2
    euler = int(used.sum()) - n_edges + len(faces)
    pieces = merged_labels(n_vertices, faces[:, :2].ravel(), faces[:, 1:].ravel())[used]
    return Patch(
        faces=faces,
        row_starts=row_starts,
        columns=columns,
        entries=entries,
        loops=loops,
        has_touching_fans=touching,
        is_disk=bool((pieces == pieces[0]).all())
        and not touching
        and len(loops) > 0
        and euler + len(loops) == 2,
        boundary=boundary,
        boundary_loops=loop_ids[boundary[:, 0]],
    )


def _loops(boundary: IntArray, n_vertices: int) -> tuple[IntArray, ...]:
    """Chain the boundary into loops, each from its lowest vertex; one edge leaves each vertex."""
    following = np.full(n_vertices, -1, dtype=np.int32)
    following[boundary[:, 0]] = boundary[:, 1]
    order, starts = loops_kernel(following)
    return tuple(np.split(order, starts[1:])) if len(starts) else ()


def is_injective(uvs: FloatArray, patch: Patch) -> bool:
    """Return whether no two triangles of a layout overlap; none of them may be flipped.

    Parameters
    ----------
    uvs : (n, 2) float64
    patch : Patch

    Examples
    --------
    >>> from texbake.mapping.atlas.flattening.patch import patch_of
    >>> patch = patch_of(np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], dtype=np.int32), 5)
    >>> angles = np.array([0.0, 1.9, 3.8, 5.7])
    >>> corners = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    >>> is_injective(np.concatenate([[[0.0, 0.0]], corners]), patch)
    True
    >>> corners[3] = 0.5 * corners[0] + 0.5 * corners[1]
    >>> is_injective(np.concatenate([[[0.0, 0.0]], corners]), patch)
    False
    """
    meeting = boundary_meeting(uvs, patch.boundary, patch.boundary_loops)
    if meeting == CROSSING:
        return False
    if meeting == APART and not patch.has_touching_fans:
        return True
    used = uvs[patch.faces.ravel()]
    depth = TOUCH_DEPTH * float((used.max(axis=0) - used.min(axis=0)).max())
    no_chart = np.zeros(len(patch.faces), dtype=np.int32)
    return not overlap_layers(uvs[patch.faces], no_chart, depth=depth).any()
