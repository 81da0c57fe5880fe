"""Reading PLY, ASCII and binary of either byte order, and writing it binary.

Based on: G. Turk, "The PLY Polygon File Format", 1994; property names after MeshLab and Blender.

A body of text is read as a table of float64 numbers, so that no digit is lost. Rows of one size are
taken from the mapped file at once; others are walked.

Read are vertex positions (x, y, z), normals (nx, ny, nz), texture coordinates (s, t or u, v or
texture_u, texture_v) and colors (red, green, blue, alpha; integers are divided by the greatest
value of their type), and of faces the polygons (vertex_indices or vertex_index), texture
coordinates (texcoord) and normals (normals) of their corners. All else is skipped, but copy_of.

Blender reads texture coordinates of vertices alone. So a vertex with several of them, or with
several normals, is written once for each, and the vertices get an integer copy_of: the row of the
vertex that a row is a copy of, its own if of none. Other programs skip it and have vertices that
are split at seams; where texbake reads it, copies are joined again.

For polygons see `texbake.mesh.polygons`; one of fewer than three corners gives no triangle. A file
without faces may have triangle strips (tristrips) instead, in which -1 begins a new strip;
triangles with a repeated vertex, which only turn a strip around, are dropped.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike, replacing
from texbake.mesh.files.conversion import (
    finite_rows,
    finite_vertices,
    linear_colors,
    srgb_bytes,
    srgb_colors,
    strip_triangles,
)
from texbake.mesh.files.ply_tables import Columns, ListColumn, read_element, read_header
from texbake.mesh.files.source import parse_numbers, read_array
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.polygons import outlines, triangulated
from texbake.mesh.weld import split_vertices, unique_corners, values_of_vertices

UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
NORMAL_NAMES = ("nx", "ny", "nz")
COLOR_NAMES = ("red", "green", "blue", "alpha")
POLYGON_NAMES = ("vertex_indices", "vertex_index")
_STRIPS = "tristrips"
# What corners of faces may have of their own.
CORNER_LISTS = ("texcoord", "normals")
COPY_OF = "copy_of"


def read_ply(path: PathLike) -> Mesh:
    """Read a PLY file; see the module for which properties are used."""
    data = read_array(path)
    header = read_header(path, data)
    body: AnyArray = data[header.end :]
    if header.order == "":
        body = parse_numbers(path, data, header.end).values
    tables: dict[str, Columns] = {}
    start = 0
    for element in header.elements:
        if "vertex" in tables and ("face" in tables or _STRIPS in tables):
            break  # what follows is not used
        tables[element.name], start = read_element(path, body, start, element, header.order)
    vertices, polygons = tables.get("vertex", {}), tables.get("face", tables.get(_STRIPS, {}))
    positions = stack_columns(vertices, ("x", "y", "z"))
    if positions is None:
        raise FileFormatError(f"{path}: its vertices have no x, y and z")
    name = next((name for name in POLYGON_NAMES if name in polygons), None)
    if name is None:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    types = {
        prop.name: prop.type
        for element in header.elements
        if element.name == "vertex"
        for prop in element.properties
    }
    sources = _sources(positions, vertices)
    if "face" in tables:
        fields = _corner_fields(path, positions, polygons, name, sources)
    else:
        fields = {"faces": _strip_faces(path, polygons[name])}
    faces = fields["faces"]
    for values, corners, names in (
        *(("uvs", "uv_faces", names) for names in UV_NAMES),
        ("normals", "normal_faces", NORMAL_NAMES),
    ):
        if values not in fields and (stacked := stack_columns(vertices, names)) is not None:
            fields |= {values: finite_rows(path, stacked, values), corners: faces}
    colors = read_colors(path, vertices, types)
    if sources is not None and faces.size and faces.min() >= 0 and faces.max() < len(sources):
        is_kept = sources == np.arange(len(sources))
        numbers = np.cumsum(is_kept, dtype=np.int32) - np.int32(1)
        positions, faces = positions[is_kept], numbers[sources[faces]]
        colors = None if colors is None else colors[is_kept]
    positions, fields["faces"], colors = finite_vertices(path, positions, faces, colors)
    return Mesh(positions=positions, colors=colors, name=Path(path).name, **fields)


def _sources(positions: FloatArray, vertices: Columns) -> Int64Array | None:
    """(V,) the row that each row is a copy of, itself if of none; None if no rows are copies."""
    copy_of = vertices.get(COPY_OF)
    n = len(positions)
    if not isinstance(copy_of, np.ndarray) or copy_of.shape != (n,) or n == 0:
        return None
    if not ((copy_of >= 0) & (copy_of < n)).all():
        return None
    sources = copy_of.astype(np.int64)
    is_unmoved = np.array_equal(positions[sources], positions)
    return sources if is_unmoved and (sources[sources] == sources).all() else None


def stack_columns(columns: Columns, names: tuple[str, ...]) -> FloatArray | None:
    """(n, len(names)) float64: columns side by side, or None where one is missing."""
    found = [
        column
        for name in names
        if isinstance(column := columns.get(name), np.ndarray) and column.ndim == 1
    ]
    if len(found) < len(names):
        return None
    stacked = np.empty((len(found[0]), len(names)))
    with np.errstate(invalid="ignore"):  # NaN that signals is NaN like any other
        for axis, column in enumerate(found):
            stacked[:, axis] = column
    return stacked


def read_colors(path: PathLike, vertices: Columns, types: dict[str, str]) -> Float32Array | None:
    """Linear vertex colors; integers are divided by 255, or if they have 16 bits by 65535."""
    names = COLOR_NAMES if "alpha" in vertices else COLOR_NAMES[:3]
    colors = stack_columns(vertices, names)
    if colors is None:
        return None
    if all(types[name] == "u1" for name in names):
        return linear_colors(colors.astype(np.uint8))
    colors = finite_rows(path, colors, "colors")
    for axis, name in enumerate(names):
        if types[name][0] in "iu":
            colors[:, axis] /= 65535.0 if types[name] == "u2" else 255.0
    return linear_colors(colors)


def _corner_fields(
    path: PathLike, positions: FloatArray, polygons: Columns, name: str, sources: Int64Array | None
) -> dict[str, Any]:
    """Faces, and the texture coordinates and normals that corners have by themselves."""
    lists, has_own_values = polygons[name], any(own in polygons for own in CORNER_LISTS)
    if isinstance(lists, np.ndarray) and lists.shape[1:] == (3,) and not has_own_values:
        return {"faces": _as_indices(path, lists)}  # triangles, all of them
    sizes, indices = read_polygons(path, polygons, name)
    joined = indices if sources is None else sources[np.clip(indices, 0, len(sources) - 1)]
    slots, of_polygons = triangulated(path, positions, joined, sizes)
    fields: dict[str, Any] = {"faces": indices[slots], "polygon_of": of_polygons}
    for column, values, corners, width in zip(
        CORNER_LISTS, ("uvs", "normals"), ("uv_faces", "normal_faces"), (2, 3), strict=True
    ):
        if column not in polygons:
            continue
        lengths, numbers = _flattened(polygons[column])
        if (lengths != width * sizes).any():
            raise FileFormatError(f"{path}: a list '{column}' has not {width} numbers a corner")
        numbers = finite_rows(path, numbers.reshape(-1, width), values)
        rows, ids = unique_corners(indices, numbers)
        fields |= {values: rows, corners: ids[slots]}
    return fields


def read_polygons(path: PathLike, polygons: Columns, name: str) -> tuple[Int64Array, IntArray]:
    """(P,) sizes of polygons, and (C,) int32 the vertices of their corners, from a column."""
    sizes, indices = _flattened(polygons[name])
    return sizes, _as_indices(path, indices)


def _strip_faces(path: PathLike, column: AnyArray | ListColumn) -> IntArray:
    """(F, 3) triangles of triangle strips, each row a strip or several with -1 between them."""
    sizes, values = _flattened(column)
    triangles = strip_triangles(np.insert(_as_indices(path, values), np.cumsum(sizes)[:-1], -1))
    a, b, c = triangles.T
    kept: IntArray = triangles[(a != b) & (b != c) & (c != a)]
    return kept


def _flattened(column: AnyArray | ListColumn) -> tuple[Int64Array, AnyArray]:
    """Length of each list, and all values after each other."""
    if isinstance(column, ListColumn):
        return column.sizes, column.values
    if column.ndim == 1:  # a scalar where a list belongs
        column = column[:, None]
    return np.full(len(column), column.shape[1], dtype=np.int64), column.flatten()


def _as_indices(path: PathLike, values: AnyArray) -> IntArray:
    values = np.require(values, requirements=["C", "A"])  # a column's rows may not be aligned
    if values.dtype == np.int32:
        return values
    if len(values) and not (
        values.min() >= -(2.0**31) and values.max() < 2.0**31  # NaN is neither
    ):
        raise MeshError(f"{path}: a position index is out of range")
    indices = values.astype(np.int32)
    if values.dtype.kind == "f" and (indices != values).any():
        raise FileFormatError(f"{path}: a position index is not a whole number")
    return indices


_BLOCK = 1 << 18  # rows put together at once


def write_ply(mesh: Mesh, path: PathLike) -> None:
    """Write a mesh without groups, as ``float`` and ``uchar`` where that loses nothing."""
    polygons = outlines(mesh)
    polygons.warn(path)
    sources, corners, faces = split_vertices(mesh)
    columns = _narrow_columns(mesh.positions[sources], ("x", "y", "z"))
    for values, ids, names in (
        (mesh.normals, mesh.normal_faces, NORMAL_NAMES),
        (mesh.uvs, mesh.uv_faces, UV_NAMES[0]),
    ):
        if values is not None and ids is not None:
            columns += _narrow_columns(values_of_vertices(values, ids, corners), names)
    if mesh.colors is not None:  # as bytes where they read back to the same bits
        colors: AnyArray = srgb_bytes(mesh.colors)
        if not np.array_equal(linear_colors(colors), mesh.colors):
            colors = srgb_colors(mesh.colors).astype(np.float32)
        columns += _narrow_columns(colors[sources], COLOR_NAMES)
    if len(sources) > mesh.n_vertices:
        columns.append((COPY_OF, sources.astype(np.int32)))
    count = "u1" if polygons.sizes.max() < 256 else "i4"
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(sources)}"]
    header += [f"property {_TYPES[column.dtype.str[1:]]} {name}" for name, column in columns]
    header.append(f"element face {len(polygons.sizes)}")
    header.append(f"property list {_TYPES[count]} int vertex_indices")
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write("\n".join([*header, "end_header\n"]).encode("ascii"))
        _write_rows(file, columns)
        _write_lists(file, count, polygons.sizes, faces.ravel()[polygons.slots])


_TYPES = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}


def _narrow_columns(rows: AnyArray, names: tuple[str, ...]) -> list[tuple[str, AnyArray]]:
    """Columns by their names, of float64 as float32 where that loses nothing."""
    if rows.dtype == np.float64:
        with np.errstate(over="ignore", under="ignore"):
            narrow = rows.astype(np.float32)
        rows = narrow if np.array_equal(narrow, rows) else rows
    return [(name, rows[:, axis]) for axis, name in enumerate(names[: rows.shape[1]])]


def _write_rows(file: io.BufferedWriter, columns: list[tuple[str, AnyArray]]) -> None:
    """Write a table of scalars."""
    fields = [(name, column.dtype.newbyteorder("<")) for name, column in columns]
    n_rows = len(columns[0][1])
    for start in range(0, n_rows, _BLOCK):
        stop = min(start + _BLOCK, n_rows)
        table = np.empty(stop - start, dtype=fields)
        for name, column in columns:
            table[name] = column[start:stop]
        file.write(table.tobytes())


def _write_lists(file: io.BufferedWriter, count: str, sizes: Int64Array, indices: IntArray) -> None:
    """Write lists of indices, each behind its length in the type `count`."""
    ends = np.cumsum(sizes)
    width = int(count[1])
    for start in range(0, len(sizes), _BLOCK):
        part = sizes[start : start + _BLOCK]
        first, stop = int(ends[start] - part[0]), int(ends[start + len(part) - 1])
        if (part == part[0]).all():
            row = [("count", "<" + count), ("indices", "<i4", (int(part[0]),))]
            table = np.empty(len(part), row)
            table["count"], table["indices"] = part[0], indices[first:stop].reshape(len(part), -1)
            file.write(table.tobytes())
            continue
        is_count = np.zeros(4 * (stop - first) + width * len(part), np.bool_)
        heads = 4 * (np.cumsum(part) - part) + width * np.arange(len(part))
        is_count[heads[:, None] + np.arange(width)] = True
        data = np.empty(len(is_count), np.uint8)
        data[is_count] = part.astype("<" + count).view(np.uint8)
        data[~is_count] = indices[first:stop].astype("<i4").view(np.uint8)
        file.write(data.tobytes())
