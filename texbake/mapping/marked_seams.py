"""What a person marked: seams, protected faces, and how important faces are.

Seams are pairs of vertices, lines in a file, or those of the mesh's own UVs.
Seams are compared by where they lie, so that vertices that a file repeats make no difference.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.seams import seam_edges
from texbake.mesh.files.source import TextLine, parse_row, read_lines
from texbake.mesh.frame import UnitGrid
from texbake.mesh.interchange import plain_array
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.topology import EdgeGraph, edge_keys, path_back
from texbake.mesh.weld import unique_rows, weld_rows

# Cells along the longest side of the mesh; a point of a file is a vertex in the same cell.
_CELLS = 2.0**20


def cuts_of(
    mesh: Mesh, faces: BoolArray, edges: npt.ArrayLike | None, options: UnwrapOptions
) -> BoolArray | None:
    """Edges of the chosen faces along which charts are cut, (n, 3) bool; None to choose them."""
    if edges is None and not options.keep_seams:
        return None
    if options.keep:
        raise OptionError("seams: charts that are kept are not cut; leave it out, or `keep`")
    if options.charts == "xatlas":
        raise OptionError("seams: xatlas does not follow given seams; use charts texbake")
    if options.symmetry == "overlap":
        raise OptionError("symmetry: overlap is for seams that texbake chooses; use auto or off")
    return marked_edges(mesh, edges, keep=options.keep_seams)[faces]


def protected_of(
    mesh: Mesh, faces: BoolArray, numbers: npt.ArrayLike | None, options: UnwrapOptions
) -> BoolArray | None:
    """(n,) bool: which of the chosen faces no seam cuts."""
    if numbers is None:
        return None
    if options.keep or options.charts == "xatlas":
        raise OptionError(
            "protect: it is for charts that texbake cuts; leave out `keep`, and use charts texbake"
        )
    if options.symmetry == "overlap":
        raise OptionError("symmetry: charts with protected faces cannot overlap; use auto or off")
    marked = np.zeros(mesh.n_faces, dtype=np.bool_)
    marked[_checked(numbers, "protect", mesh, "face")] = True
    return marked[faces]


def importance_of(mesh: Mesh, faces: BoolArray, values: npt.ArrayLike | None) -> FloatArray | None:
    """(n,) importance of the chosen faces, from 0 to 1."""
    if values is None:
        return None
    importance = plain_array(values, "importance").astype(np.float64)
    if importance.shape != (mesh.n_faces,):
        raise OptionError(
            f"importance: the array has the shape {importance.shape}; pass one number for each of "
            f"the {mesh.n_faces} faces of {mesh.name}"
        )
    if not ((importance >= 0.0) & (importance <= 1.0)).all():
        raise OptionError("importance: some numbers are not in the range 0 to 1")
    return importance[faces]


def marked_edges(mesh: Mesh, edges: npt.ArrayLike | None, *, keep: bool = False) -> BoolArray:
    """(F, 3) edges to cut along, by pairs of vertices (E, 2); `keep`: also the seams of uvs."""
    marked = seam_edges(mesh) if keep else np.zeros((mesh.n_faces, 3), dtype=bool)
    if edges is None:
        return marked
    pairs = _checked(edges, "seams", mesh, "vertex", 2)
    places = weld_rows(mesh.positions)
    keys = _keys(mesh, places)
    wanted = edge_keys(*places[pairs].T)
    missing = np.flatnonzero(~np.isin(wanted, keys))
    if len(missing):
        one, other = pairs[missing[0]]
        raise OptionError(f"seams: {mesh.name} has no edge between its vertices {one} and {other}")
    return marked | np.isin(keys, wanted)


def _keys(mesh: Mesh, places: IntArray) -> Int64Array:
    """(F, 3) int64: `edge_keys` of the edges from each corner to the next."""
    corners = places[mesh.faces]
    return edge_keys(corners, np.roll(corners, -1, axis=1))


def _checked(values: npt.ArrayLike, option: str, mesh: Mesh, kind: str, *row: int) -> Int64Array:
    """Check numbers of vertices or faces of a mesh, in rows of the shape `row`."""
    numbers = plain_array(values, option)
    if numbers.size == 0:
        return np.empty((0, *row), np.int64)
    is_integer = np.issubdtype(numbers.dtype, np.integer)
    if numbers.ndim == 0 or numbers.shape[1:] != row or not is_integer:
        wanted = "pairs of vertices, (E, 2) int" if row else "numbers of faces, (n,) int"
        raise OptionError(
            f"{option}: the array has type {numbers.dtype} and shape {numbers.shape}; pass {wanted}"
        )
    n, all_ = (mesh.n_vertices, "vertices") if kind == "vertex" else (mesh.n_faces, "faces")
    worst = numbers.min() if numbers.min() < 0 else numbers.max()
    if not 0 <= worst < n:
        raise OptionError(
            f"{option}: a {kind} is {worst}; the {all_} of {mesh.name} are 0 to {n - 1}"
        )
    return numbers.astype(np.int64)


def read_seams(path: PathLike, mesh: Mesh) -> Int64Array:
    """(E, 2) pairs of vertices from lines (`l`) of an OBJ file, along shortest paths."""
    points, lines = _read_lines(path)
    vertices = _vertices_at(path, points, mesh)
    places = weld_rows(mesh.positions)
    wanted = [
        (number, *pair)
        for number, ends in lines
        for pair in pairwise(places[vertices[ends]].tolist())
        if pair[0] != pair[1]
    ]
    rows = np.array(wanted, dtype=np.int64).reshape(-1, 3)
    is_edge = np.isin(edge_keys(rows[:, 1], rows[:, 2]), _keys(mesh, places))
    found = rows[is_edge, 1:].tolist()
    graph = None if is_edge.all() else _polygon_edges(mesh, places)
    for number, start, end in rows[~is_edge].tolist():
        assert graph is not None
        steps = path_back(graph.paths_from(start, end)[1], end)
        if steps[-1] != start:
            raise FileFormatError(
                f"{path}: line {number}: no edges of {mesh.name} join two of its points"
            )
        found += [(one, other) for other, one in pairwise(steps)]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def faces_at(marked: Mesh, mesh: Mesh) -> Int64Array:
    """(n,) faces of a mesh that lie where faces of another do."""
    grid = UnitGrid.around(mesh)
    points = np.concatenate([grid.to_grid(each.positions, _CELLS) for each in (mesh, marked)])
    places = weld_rows(points)
    corners = np.concatenate([places[mesh.faces], places[marked.faces + len(mesh.positions)]])
    numbers = unique_rows(np.sort(corners, axis=1))[1]
    return np.flatnonzero(np.isin(numbers[: mesh.n_faces], numbers[mesh.n_faces :]))


def _read_lines(path: PathLike) -> tuple[FloatArray, list[tuple[int, IntArray]]]:
    """Points of an OBJ file, and the points of each of its lines with its number in the file."""
    points: list[list[float]] = []
    lines = []
    for line in read_lines(path, "an OBJ file with lines"):
        kind, *words = line.words
        if kind == "v":
            points.append(parse_row(path, TextLine(line.number, words[:3]), 3, "a vertex"))
        elif kind == "l":
            rows = parse_row(
                path,
                TextLine(line.number, [word.partition("/")[0] for word in words]),
                len(words),
                "a line",
            )
            ends = np.clip(rows, -(2**31), 2**31 - 1).astype(np.int64)
            ends = np.where(ends < 0, len(points) + ends, ends - 1)
            if len(ends) < 2 or ends.min() < 0 or ends.max() >= len(points):
                raise FileFormatError(
                    f"{path}: line {line.number}: a line needs two or more of the vertices above it"
                )
            lines.append((line.number, ends.astype(np.int32)))
    if not lines:
        raise FileFormatError(
            f"{path}: it has no lines (`l`); write the edges of the seams as lines of an OBJ file"
        )
    return np.array(points), lines


def _vertices_at(path: PathLike, points: FloatArray, mesh: Mesh) -> Int64Array:
    """(n,) int64: the vertex of the mesh at each point."""
    grid = UnitGrid.around(mesh)
    of_mesh, cells = (grid.to_grid(rows, _CELLS) for rows in (mesh.positions, points))
    firsts = weld_rows(np.concatenate([of_mesh, cells]))[len(of_mesh) :]
    for i in np.flatnonzero(firsts >= len(of_mesh)):  # on the other side of a border of cells
        distances = pm.norm(of_mesh - cells[i], axis=1)
        nearest = int(distances.argmin())
        if distances[nearest] > 2.0 / _CELLS:
            x, y, z = points[i]
            raise FileFormatError(
                f"{path}: no vertex of {mesh.name} is at the point ({x:g}, {y:g}, {z:g}); "
                "use vertices of the mesh as points"
            )
        firsts[i] = nearest
    return firsts.astype(np.int64)


def _polygon_edges(mesh: Mesh, places: IntArray) -> EdgeGraph:
    """The edges of the polygons of a mesh, by their lengths."""
    corners = places[mesh.faces]
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    if mesh.polygon_of is not None:
        # A diagonal has both its faces in one polygon.
        ends = np.minimum(tails, heads), np.maximum(tails, heads)
        firsts, numbers = unique_rows(np.stack([*ends, np.repeat(mesh.polygon_of, 3)], axis=1))
        once = firsts[np.bincount(numbers) == 1]
        tails, heads = tails[once], heads[once]
    starts, ends = np.concatenate([[tails, heads], [heads, tails]], axis=1)
    lengths = pm.norm(mesh.positions[ends] - mesh.positions[starts], axis=1)
    return EdgeGraph.build(mesh.n_vertices, starts, ends, lengths)
