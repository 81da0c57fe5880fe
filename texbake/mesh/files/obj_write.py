"""Writing Wavefront OBJ: every float64 in the shortest text that reads back to the same bits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.files import PathLike, replacing
from texbake.mesh.files.text_write import write_rows
from texbake.mesh.mesh import IntArray, Mesh


def write_obj(mesh: Mesh, path: PathLike) -> None:
    """Write positions, colors, texture coordinates, normals, faces and groups.

    What `read_obj` reads back is equal bit for bit, faces in their order; but groups are numbered
    in the order in which faces use them, names without a face are dropped, and control characters
    in a name become spaces. Corner tangents have no place in the format.

    Raises
    ------
    FileError
        The file cannot be written; one that stood there is left as it was.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        points = mesh.positions
        if mesh.colors is not None:
            points = np.concatenate([points, mesh.colors.astype(np.float64)], axis=1)
        write_rows(file, "v" + " %r" * points.shape[1] + "\n", points)
        if mesh.uvs is not None:
            write_rows(file, "vt %r %r\n", mesh.uvs)
        if mesh.normals is not None:
            write_rows(file, "vn %r %r %r\n", mesh.normals)
        corners = _corner_indices(mesh)
        corner_format = {
            (False, False): " %d",
            (True, False): " %d/%d",
            (False, True): " %d//%d",
            (True, True): " %d/%d/%d",
        }[mesh.uvs is not None, mesh.normals is not None]
        for name, start, stop in _group_runs(mesh):
            if name is not None:
                file.write(f"g {name}\n".encode("utf-8", "replace"))
            write_rows(file, "f" + 3 * corner_format + "\n", corners[start:stop])


def _corner_indices(mesh: Mesh) -> IntArray:
    """(F, 3 * n) indices from 1, n of them a corner: position, and those that the mesh has."""
    indices = [mesh.faces]
    if mesh.uv_faces is not None:
        indices.append(mesh.uv_faces)
    if mesh.normal_faces is not None:
        indices.append(mesh.normal_faces)
    return np.stack(indices, axis=2).reshape(mesh.n_faces, -1) + np.int32(1)


def _group_runs(mesh: Mesh) -> Iterator[tuple[str | None, int, int]]:
    """Name, first and last + 1 of each run of faces of one group; None for a mesh without."""
    if mesh.face_groups is None:
        yield None, 0, mesh.n_faces
        return
    starts = np.flatnonzero(np.diff(mesh.face_groups, prepend=-1)).tolist()
    for start, stop in zip(starts, [*starts[1:], mesh.n_faces], strict=True):
        name = mesh.group_names[mesh.face_groups[start]]
        yield "".join(" " if ord(sign) < 32 else sign for sign in name).strip(), start, stop
