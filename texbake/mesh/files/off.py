"""Reading and writing OFF, the Object File Format of Geomview.

Based on: S. Levy, T. Munzner, M. Phillips, "Geomview Manual", section OFF, 1993.

The first word says what each vertex has: [ST][C][N][4][n]OFF, for texture coordinates, colors,
normals, a fourth coordinate, and n dimensions; files with the last two are refused. The word may be
missing.
Everything from ``#`` to the end of a line is a comment. Each vertex and each face has a line of its
own; what follows the indices of a face, its color, is skipped. For polygons see
`texbake.mesh.polygons`; one of fewer than three corners gives no triangle.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike, replacing
from texbake.mesh.files.conversion import finite_rows, finite_vertices, unit_colors
from texbake.mesh.files.source import (
    TextNumbers,
    parse_numbers,
    read_array,
    text_of,
    write_lists,
    write_rows,
)
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.polygons import outlines, triangulated

# Comments and blank lines before the first word are skipped, and never divided in another way.
_FIRST_WORD = re.compile(rb"\A(?:\s|#[^\r\n]*+)*+(ST)?(C)?(N)?(4)?(n)?OFF\b")
_BINARY = re.compile(rb"[ \t]*BINARY\b")


def read_off(path: PathLike) -> Mesh:
    """Read an OFF file; whole colors with one above 1 are taken to go up to 255."""
    data = text_of(path, read_array(path), "an ASCII OFF file")
    first_word = _FIRST_WORD.match(data[:65536].data)
    textured, colored, shaded, *extra = first_word.groups() if first_word else (None,) * 5
    start = first_word.end() if first_word else 0
    if any(extra) or _BINARY.match(data[start : start + 64].data):
        raise FileFormatError(f"{path}: this kind of OFF is not read; convert it to ASCII, 3D")
    numbers = parse_numbers(path, data, start)
    rows = np.append(numbers.lines, len(numbers.values))
    n_vertices, n_faces = _counts(path, numbers)
    if len(rows) - 2 < n_vertices + n_faces:
        raise FileFormatError(
            f"{path}: it promises {n_vertices} vertices and {n_faces} faces, but has "
            f"{len(rows) - 2} lines for them; it is truncated, or not an OFF file"
        )
    vertex_rows, face_rows = rows[1 : n_vertices + 2], rows[n_vertices + 1 :][: n_faces + 1]
    sizes, corners = _polygons(path, numbers.values, face_rows)
    if not (sizes > 2).any():
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    needed = 3 + (3 if shaded else 0) + (3 if colored else 0) + (2 if textured else 0)
    # The numbers that every vertex line has.
    width = int(np.diff(vertex_rows).min(initial=needed if n_vertices == 0 else 1 << 20))
    if width < needed:
        raise FileFormatError(f"{path}: a vertex has {width} numbers; {needed} are needed")
    table = numbers.values[vertex_rows[:-1, None] + np.arange(width)]
    positions = np.ascontiguousarray(table[:, :3])
    slots, polygons = triangulated(path, positions, corners, sizes)
    faces = corners[slots]
    fields: dict[str, Any] = {"positions": positions, "faces": faces, "polygon_of": polygons}
    fields["name"] = Path(path).name
    column = 3
    if shaded:
        fields |= {"normals": finite_rows(path, table[:, 3:6], "normals"), "normal_faces": faces}
        column = 6
    if colored:
        width = min(table.shape[1] - column - (2 if textured else 0), 4)
        fields["colors"] = unit_colors(path, table[:, column : column + width])
        column += width
    if textured:
        uvs = finite_rows(path, table[:, column : column + 2], "uvs")
        fields |= {"uvs": uvs, "uv_faces": faces}
    fields["positions"], fields["faces"], fields["colors"] = finite_vertices(
        path, fields["positions"], faces, fields.get("colors")
    )
    return Mesh(**fields)


def _counts(path: PathLike, numbers: TextNumbers) -> tuple[int, int]:
    """Numbers of vertices and faces, from the first line of numbers."""
    first = numbers.values[: numbers.lines[1] if len(numbers.lines) > 1 else None]
    counts = first[:2]
    if len(counts) < 2 or not ((counts >= 0) & (counts == np.floor(counts))).all():
        raise FileFormatError(f"{path}: it is not an OFF file; it does not begin with its counts")
    if counts.max() > np.iinfo(np.int32).max:
        raise FileFormatError(f"{path}: it is too large; indices must fit 32 bits")
    return int(counts[0]), int(counts[1])


def _polygons(path: PathLike, values: FloatArray, rows: Int64Array) -> tuple[Int64Array, IntArray]:
    """Sizes and corners of the face lines: a count, that many indices, and what follows them."""
    starts = rows[:-1]
    counts = values[starts]
    if not ((counts >= 0) & (counts == np.floor(counts)) & (counts < np.diff(rows))).all():
        raise FileFormatError(
            f"{path}: a face has fewer indices than it claims; the file is damaged"
        )
    sizes = counts.astype(np.int64)
    # Corners are counted without the numbers between them.
    before = np.repeat(starts + 1 - (np.cumsum(sizes) - sizes), sizes)
    corners = values[np.arange(len(before)) + before]
    if not (np.abs(corners) < 2.0**31).all():
        raise MeshError(f"{path}: a position index is out of range")
    vertices: IntArray = corners.astype(np.int32)
    if (vertices != corners).any():
        raise FileFormatError(f"{path}: a position index is not a whole number")
    return sizes, vertices


def write_off(mesh: Mesh, path: PathLike) -> None:
    """Write positions and polygons, and nothing else; positions read back bit-equal."""
    polygons = outlines(mesh)
    polygons.warn(path)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(f"OFF\n{mesh.n_vertices} {len(polygons.sizes)} 0\n".encode("ascii"))
        write_rows(file, "%r %r %r\n", mesh.positions)
        vertices = mesh.faces.ravel()[polygons.slots]
        write_lists(file, lambda size: f"{size}{size * ' %d'}\n", polygons.sizes, vertices)
