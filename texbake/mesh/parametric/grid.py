"""How a lattice of (u, v) becomes a mesh: lines, seams, poles, and the arrays of a `Mesh`.

A surface is laid out on lines of constant u (columns) and of constant v (rows), cut open where it
closes on itself. Nodes are where they cross. Several nodes can be one vertex: at a seam, where a
normal jumps along a crease, or at a pole, where a whole row is one point. Each node has its own
texture coordinates and normal, and those that are equal at one vertex are stored once.

The triangle of a square with a side that is one point has its own node there, in the middle of
that side: the fan around a pole takes the middle u of each of its faces. To name such nodes,
positions on the lattice are counted in half steps: line k is 2 k.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.compose import used_rows
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.topology import repeated_vertices
from texbake.mesh.weld import unique_rows
from texbake.records import dataclass


def grid_quads(n_rows: int, n_columns: int) -> IntArray:
    """(n_rows · n_columns, 4): corners of grid cells: itself, next row, diagonal, next column."""
    first = (np.arange(n_rows)[:, None] * (n_columns + 1) + np.arange(n_columns)).ravel()
    return first.astype(np.int32)[:, None] + np.array(
        [0, n_columns + 1, n_columns + 2, 1], dtype=np.int32
    )


def ids_around(n_rows: int, n_columns: int) -> IntArray:
    """Vertex ids of a grid whose column `n_columns` is column 0 again."""
    columns = np.arange(n_columns + 1) % n_columns
    return (np.arange(n_rows)[:, None] * n_columns + columns).ravel().astype(np.int32)


def split_quads(quads: IntArray) -> IntArray:
    """(2 Q, 3) int32: two triangles of each quad, along the diagonal from its first corner."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)


def open_lines(n_steps: int) -> IntArray:
    """Lines from one border to the other, each of vertices of its own."""
    return np.arange(n_steps + 1, dtype=np.int32)


def closed_lines(n_steps: int) -> IntArray:
    """Lines of which the last has the vertices of the first."""
    return np.arange(n_steps + 1, dtype=np.int32) % n_steps


def half_steps(values: FloatArray) -> FloatArray:
    """(2 L - 1, ...): values at the lines, and between two of them their mean."""
    result = np.empty((2 * len(values) - 1, *values.shape[1:]))
    result[0::2] = values
    result[1::2] = 0.5 * (values[:-1] + values[1:])
    return result


def part_way(
    first: npt.ArrayLike, last: npt.ArrayLike, step: npt.ArrayLike, steps: npt.ArrayLike
) -> FloatArray:
    """Values after `step` of `steps` equal steps, counted from the nearer end; ends are exact."""
    first, last, step, steps = (np.asarray(given) for given in (first, last, step, steps))
    near = 2 * step <= steps
    start, towards = np.where(near, first, last), np.where(near, last, first)
    return np.asarray(start + (towards - start) * (np.where(near, step, steps - step) / steps))


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Triangles between nodes of a lattice."""

    # (N, 2) int32; column and row of each node, in half steps; with more columns, what else a node
    # belongs to.
    nodes: IntArray
    vertex_ids: IntArray  # (N,) int32; the vertex that each node is at
    # (F, 3) int32; indices into `nodes`, counter-clockwise where u goes right and v up.
    faces: IntArray


def lattice(columns: IntArray, rows: IntArray) -> tuple[IntArray, IntArray]:
    """Nodes (C R, 2) where lines cross, row by row, and squares (Q, 4), counter-clockwise."""
    nodes = np.stack(np.meshgrid(2 * np.arange(len(columns)), 2 * np.arange(len(rows))), axis=-1)
    across = np.flatnonzero(columns[:-1] != columns[1:])
    along = np.flatnonzero(rows[:-1] != rows[1:])
    first = (along[:, None] * len(columns) + across).ravel()
    quads = first[:, None] + np.array([0, 1, len(columns) + 1, len(columns)])
    return nodes.reshape(-1, 2).astype(np.int32), quads.astype(np.int32)


def make_grid(
    columns: IntArray, rows: IntArray, *, poles: BoolArray | None = None, twisted: bool = False
) -> SurfaceGrid:
    """Lay a surface out on lines; `poles` (R,) are one vertex, and `twisted` joins in reverse."""
    nodes, quads = lattice(columns, rows)
    column, row = nodes.T // 2
    vertex_columns, vertex_rows = columns[column], rows[row]
    if twisted:
        last = column == len(columns) - 1
        vertex_rows[last] = vertex_rows[last][::-1]
    if poles is not None:
        vertex_columns[poles[row]] = 0
    vertex_ids = vertex_rows * (columns.max() + 1) + vertex_columns
    return triangulate(nodes, vertex_ids, quads)


def triangulate(nodes: IntArray, vertex_ids: IntArray, quads: IntArray) -> SurfaceGrid:
    """Split squares of nodes (Q, 4), counter-clockwise, of which one side may be a vertex."""
    corners = vertex_ids[quads]
    shrunk = corners == np.roll(corners, -1, axis=1)  # side k, from corner k to the next
    n_shrunk = shrunk.sum(axis=1)
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]]
    kept = np.ones((len(quads), 2), dtype=bool)
    kept[n_shrunk > 1] = False
    fans, sides = np.nonzero(shrunk & (n_shrunk == 1)[:, None])
    if len(fans):
        starts, ends = quads[fans, sides], quads[fans, (sides + 1) % 4]
        triangles[fans, 0, 0] = len(nodes) + np.arange(len(fans))
        triangles[fans, 0, 1] = quads[fans, (sides + 2) % 4]
        triangles[fans, 0, 2] = quads[fans, (sides + 3) % 4]
        kept[fans, 1] = False
        nodes = np.concatenate([nodes, (nodes[starts] + nodes[ends]) // 2])
        vertex_ids = np.concatenate([vertex_ids, vertex_ids[starts]])
    faces = triangles[kept]
    return SurfaceGrid(nodes, vertex_ids, faces[~repeated_vertices(vertex_ids[faces])])


def grid_mesh(
    grid: SurfaceGrid,
    *,
    name: str,
    positions: FloatArray,
    uvs: FloatArray,
    normals: FloatArray | None = None,
    face_groups: IntArray | None = None,
    group_names: tuple[str, ...] = (),
) -> Mesh:
    """Mesh of a grid by values of nodes (N, ...), the first of a vertex, without unused ones."""
    kept, node_faces = used_rows(grid.faces, len(grid.nodes))

    first_nodes, vertex_of = unique_rows(grid.vertex_ids[kept][:, np.newaxis])
    uvs = uvs[kept]
    first_uvs, uv_of = unique_rows(np.column_stack([vertex_of, uvs]))
    mesh = Mesh(
        positions=positions[kept][first_nodes] + 0.0,  # -0.0 becomes 0.0
        faces=vertex_of[node_faces],
        uvs=uvs[first_uvs],
        uv_faces=uv_of[node_faces],
        face_groups=face_groups,
        group_names=group_names,
        name=name,
    )
    if normals is None:
        return mesh
    normals = normals[kept] + 0.0
    first_normals, normal_of = unique_rows(normals)
    return mesh.replace(normals=normals[first_normals], normal_faces=normal_of[node_faces])


def circle_points(n_points: int) -> FloatArray:
    """(n, 2) cosine and sine of k / n of a turn, never -0."""
    eighths = 8 * np.arange(n_points, dtype=np.int64)
    octants, rests = eighths // n_points, eighths % n_points
    parts = np.where(octants % 2 == 1, n_points - rests, rests)
    angles = parts * (np.pi / 4.0) / n_points
    cosines = np.where(parts == n_points, np.sqrt(0.5), pm.cos(angles))
    sines = np.where(parts == n_points, np.sqrt(0.5), pm.sin(angles))
    # In octants 1, 2, 5 and 6 the point is nearer to the y axis than to the x axis.
    steep = ((octants + 1) // 2) % 2 == 1
    x, y = np.where(steep, sines, cosines), np.where(steep, cosines, sines)
    left = (octants >= 2) & (octants < 6)
    points = np.stack([np.where(left, -x, x), np.where(octants >= 4, -y, y)], axis=-1)
    return points + 0.0  # -0.0 becomes 0.0
