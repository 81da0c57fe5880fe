"""The neighbors and the outline of a patch: a few triangles that are to lie in the plane together.

Rows of a sparse matrix over the vertices of a patch hold a vertex itself and then those that it
shares an edge with, so that whatever is assembled from triangles has its place found beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.adjacency import merged_labels
from texbake.mesh.mesh import IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Triangles of a patch, and how they hang together.

    Attributes
    ----------
    faces : (m, 3) int32
        Indices of vertices below n.
    row_starts : (n + 1,) int32
        Entries of vertex i are `row_starts[i]` to `row_starts[i + 1] - 1`.
    columns : (k,) int32
        The vertex of each entry; the first of row i is i.
    entries : (m, 3, 3) int32
        Of row corner i and column corner j of each triangle.
    boundary : (b, 2) int32
        Edges of one triangle only, in its direction.
    boundary_loops : (b,) int32
        Loop of each of these edges; 0 for all if there are touching fans.
    loops : tuple of (l,) int32
        Boundary loops, each in the direction of its triangles; none if there are touching fans.
    has_touching_fans : bool
        Whether some vertex has more than one boundary edge that leaves it.
    is_disk : bool
        The patch is in one piece, and a disk once all its loops but one are filled.
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
        """Number of vertices, those included that no triangle uses."""
        return len(self.row_starts) - 1


def patch_of(faces: IntArray, n_vertices: int) -> Patch | None:
    """Find neighbors and boundary of a patch.

    Parameters
    ----------
    faces : (m, 3) int32
    n_vertices : int

    Returns
    -------
    Patch or None
        None for what is no oriented surface: an edge of more than two triangles, or of two that
        run along it in one direction, or a triangle that has a vertex twice; and for no triangle.
    """
    if len(faces) == 0:
        return None
    faces = np.array(faces, dtype=np.int32, order="C")  # writable: one signature of the kernels
    row_starts, columns, entries, boundary, is_surface = _neighbors_kernel(faces, n_vertices)
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
    """Chain edges where each vertex has one that leaves it; from the lowest vertex of each loop."""
    following = np.full(n_vertices, -1, dtype=np.int32)
    following[boundary[:, 0]] = boundary[:, 1]
    order, starts = _loops_kernel(following)
    return tuple(np.split(order, starts[1:])) if len(starts) else ()


@kernel
def _neighbors_kernel(faces, n_vertices):  # type: ignore[no-untyped-def]
    """Rows of neighbors, where each pair of corners has its entry, and edges of one triangle."""
    loose_starts = np.zeros(n_vertices + 1, dtype=np.int64)
    for face in range(len(faces)):
        for i in range(3):
            loose_starts[faces[face, i] + 1] += 2
    for vertex in range(n_vertices):
        loose_starts[vertex + 1] += loose_starts[vertex] + 1
    loose = np.empty(loose_starts[n_vertices], dtype=np.int32)
    leaving = np.zeros(len(loose), dtype=np.int32)  # triangle edges from the row to the column
    arriving = np.zeros(len(loose), dtype=np.int32)
    lengths = np.ones(n_vertices, dtype=np.int32)
    for vertex in range(n_vertices):
        loose[loose_starts[vertex]] = vertex
    entries = np.zeros((len(faces), 3, 3), dtype=np.int32)
    is_surface = True
    for face in range(len(faces)):
        for i in range(3):
            row = faces[face, i]
            start = loose_starts[row]
            for j in range(3):
                column = faces[face, j]
                at = 0
                while at < lengths[row] and loose[start + at] != column:
                    at += 1
                if at == lengths[row]:
                    loose[start + at] = column
                    lengths[row] += 1
                entries[face, i, j] = at
                if j == (i + 1) % 3:
                    leaving[start + at] += 1
                elif j != i:
                    arriving[start + at] += 1
                if j != i and (at == 0 or leaving[start + at] > 1 or arriving[start + at] > 1):
                    is_surface = False

    row_starts = np.zeros(n_vertices + 1, dtype=np.int32)
    n_boundary = 0
    for row in range(n_vertices):
        row_starts[row + 1] = row_starts[row] + lengths[row]
        for at in range(loose_starts[row] + 1, loose_starts[row] + lengths[row]):
            n_boundary += leaving[at] > arriving[at]
    columns = np.empty(row_starts[n_vertices], dtype=np.int32)
    boundary = np.empty((n_boundary, 2), dtype=np.int32)
    n_boundary = 0
    for row in range(n_vertices):
        for at in range(lengths[row]):
            loose_at = loose_starts[row] + at
            columns[row_starts[row] + at] = loose[loose_at]
            if at > 0 and leaving[loose_at] > arriving[loose_at]:
                boundary[n_boundary, 0], boundary[n_boundary, 1] = row, loose[loose_at]
                n_boundary += 1
    for face in range(len(faces)):
        for i in range(3):
            for j in range(3):
                entries[face, i, j] += row_starts[faces[face, i]]
    return row_starts, columns, entries, boundary, is_surface


@kernel
def _loops_kernel(following):  # type: ignore[no-untyped-def]
    """Vertices in the order of loops, and where each loop starts."""
    seen = np.zeros(len(following), dtype=np.bool_)
    order = np.empty(len(following), dtype=np.int32)
    starts = np.empty(len(following), dtype=np.int32)
    n_ordered, n_loops = 0, 0
    for first in range(len(following)):
        if following[first] < 0 or seen[first]:
            continue
        starts[n_loops] = n_ordered
        n_loops += 1
        vertex = first
        while not seen[vertex]:
            seen[vertex] = True
            order[n_ordered] = vertex
            n_ordered += 1
            vertex = following[vertex]
    return order[:n_ordered], starts[:n_loops]
