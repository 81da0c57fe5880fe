"""Writing binary PLY, little-endian, such that positions come back bit-equal."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike, replacing
from texbake.mesh.mesh import FloatArray, IntArray, Mesh

_BLOCK = 1 << 18  # rows put together at once


def write_ply(mesh: Mesh, path: PathLike) -> None:
    """Write positions, colors, faces, texture coordinates and normals.

    Numbers are written as ``float`` where that loses nothing, else as ``double``, and colors as
    ``uchar`` where that loses nothing. Texture coordinates and normals are vertex properties where
    all corners of a vertex agree on them, else lists of the faces: ``texcoord``, which other
    programs read, and ``normals``, which only texbake reads, for the format has nothing for normals
    of corners. Groups and tangents have no place in the format.

    Raises
    ------
    FileError
        The file cannot be written; one that stood there is left as it was.
    """
    vertex_columns = _columns(mesh.positions, ("x", "y", "z"))
    face_columns: list[tuple[str, npt.NDArray[Any]]] = [("vertex_indices", mesh.faces)]
    for values, corners, names, list_name in (
        (mesh.normals, mesh.normal_faces, ("nx", "ny", "nz"), "normals"),
        (mesh.uvs, mesh.uv_faces, ("s", "t"), "texcoord"),
    ):
        if values is None or corners is None:
            continue
        by_vertex = _by_vertex(mesh, values, corners)
        if by_vertex is not None:
            vertex_columns += _columns(by_vertex, names)
        else:
            rows = values[corners].reshape(mesh.n_faces, -1)
            face_columns.append((list_name, _narrowed(rows)))
    if mesh.colors is not None:
        vertex_columns += _columns(_color_bytes(mesh.colors), ("red", "green", "blue", "alpha"))
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {mesh.n_vertices}"]
    header += [f"property {_TYPES[column.dtype.str[1:]]} {name}" for name, column in vertex_columns]
    header.append(f"element face {mesh.n_faces}")
    header += [
        f"property list uchar {_TYPES[column.dtype.str[1:]]} {name}"
        for name, column in face_columns
    ]
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write("\n".join([*header, "end_header\n"]).encode("ascii"))
        _write_rows(file, vertex_columns, lists=False)
        _write_rows(file, face_columns, lists=True)


_TYPES = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}


def _columns(rows: npt.NDArray[Any], names: tuple[str, ...]) -> list[tuple[str, npt.NDArray[Any]]]:
    narrowed = _narrowed(rows)
    return [(name, narrowed[:, axis]) for axis, name in enumerate(names[: rows.shape[1]])]


def _narrowed(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """As float32 where that loses nothing; integers and float32 are left as they are."""
    if rows.dtype != np.float64:
        return rows
    with np.errstate(over="ignore", under="ignore"):
        narrow = rows.astype(np.float32)
    return narrow if np.array_equal(narrow, rows) else rows


def _color_bytes(colors: npt.NDArray[np.float32]) -> npt.NDArray[Any]:
    """As bytes where they read back to the same bits."""
    scaled = np.clip(np.nan_to_num(np.round(colors * 255.0)), 0, 255).astype(np.uint8)
    exact = np.array_equal((scaled.astype(np.float64) / 255.0).astype(np.float32), colors)
    return scaled if exact else colors


def _by_vertex(mesh: Mesh, values: FloatArray, corners: IntArray) -> FloatArray | None:
    """(V, k) values, zero for vertices that no face uses; None where corners disagree."""
    last_corners = np.full(mesh.n_vertices, -1, dtype=np.int64)
    last_corners[mesh.faces.ravel()] = corners.ravel()
    if not np.array_equal(last_corners[mesh.faces], corners) and not np.array_equal(
        values[last_corners[mesh.faces]], values[corners]
    ):
        return None
    by_vertex = values[last_corners]
    by_vertex[last_corners < 0] = 0.0
    return by_vertex


def _write_rows(
    file: io.BufferedWriter, columns: list[tuple[str, npt.NDArray[Any]]], *, lists: bool
) -> None:
    """Write a table; each column is (n,) scalars or, with `lists`, (n, k) lists of length k."""
    fields: list[Any] = []
    for name, column in columns:
        if lists:
            fields.append((f"{name} count", "u1"))
        fields.append((name, column.dtype.newbyteorder("<"), column.shape[1:]))
    n_rows = len(columns[0][1])
    for start in range(0, n_rows, _BLOCK):
        stop = min(start + _BLOCK, n_rows)
        table = np.empty(stop - start, dtype=fields)
        for name, column in columns:
            if lists:
                table[f"{name} count"] = column.shape[1]
            table[name] = column[start:stop]
        file.write(table.tobytes())
