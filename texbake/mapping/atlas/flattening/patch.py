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
import numpy.typing as npt

from texbake.core import core
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import FloatArray, IntArray

# Borders count as touching, not overlapping, up to this share of the longer side of the layout.
# `core/boundary_meeting.c` and its header have the same numbers.
_TOUCH_DEPTH = 2.0**-21
_APART, _CROSSING = 0, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Triangles of a patch, and how they are connected.

    Attributes
    ----------
    faces : (m, 3) int32
        Indices of vertices below n.
    row_starts : (n + 1,) int64
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
    row_starts: npt.NDArray[np.int64]
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

    Kernel: `core/patch_graph.c`.

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
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    row_starts = np.empty(n_vertices + 1, dtype=np.int64)
    columns = np.empty(n_vertices + 6 * len(faces), dtype=np.int32)
    entries = np.empty((len(faces), 3, 3), dtype=np.int32)
    boundary = np.empty((3 * len(faces), 2), dtype=np.int32)
    n_boundary = core.find_patch_neighbors(faces, row_starts, columns, entries, boundary)
    if n_boundary < 0:
        return None
    columns, boundary = columns[: row_starts[-1]].copy(), boundary[:n_boundary].copy()
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
    order = np.empty(n_vertices, dtype=np.int32)
    starts = np.empty(n_vertices + 1, dtype=np.int64)
    n_loops = core.chain_loops(following, order, starts)
    return tuple(order[starts[i] : starts[i + 1]] for i in range(n_loops))


def is_injective(uvs: FloatArray, patch: Patch) -> bool:
    """Return whether no two triangles of a layout overlap; none of them may be flipped.

    Kernel: `core/boundary_meeting.c`.

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
    meeting = core.boundary_meeting(uvs, patch.boundary, patch.boundary_loops)
    if meeting == _CROSSING:
        return False
    if meeting == _APART and not patch.has_touching_fans:
        return True
    used = uvs[patch.faces.ravel()]
    depth = _TOUCH_DEPTH * float((used.max(axis=0) - used.min(axis=0)).max())
    no_chart = np.zeros(len(patch.faces), dtype=np.int32)
    return not overlap_layers(uvs[patch.faces], no_chart, depth=depth).any()
