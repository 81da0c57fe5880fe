"""Reading Wavefront OBJ.

Based on: Wavefront Technologies, "Object Files (.obj)", appendix B1 of the Advanced Visualizer
manual; vertex colors ``v x y z r g b`` as MeshLab and ZBrush write them.

What the format leaves open, or files do differently, is decided so:

- A polygon is fanned out from its first corner. A face of fewer than three corners is an error.
- A face belongs to its object and group, named ``object/group``, or the one name where only one is
  set or both are equal; a new ``o`` ends the group before it. The rest of the line is the name,
  with its spaces. Where a file has neither ``o`` nor ``g``, its materials are the groups. Faces
  before the first of these are of the group ``default``.
- Corners without ``vt`` in a file whose other corners have one get one more coordinate at (0, 0),
  so that such faces cover no area of the texture; those without ``vn`` get a zero normal, which
  shades as if it were computed.
- A fourth value of ``v`` is a weight and is dropped; a sixth and seventh make values 4 to 7 a
  color. Colors that are all whole numbers with one above 1 are taken to go up to 255. Vertices
  without a color in a file that has some are white.
- Lines, points, curves, smoothing groups and unknown statements are skipped.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mesh.files.colors import unit_colors
from texbake.mesh.files.obj_statements import (
    MARK,
    F,
    Lines,
    V,
    find_lines,
    read_corners,
    read_values,
)
from texbake.mesh.files.polygons import fan_corners
from texbake.mesh.files.source import ByteArray, decode_name, map_file, require_text
from texbake.mesh.mesh import FloatArray, IntArray, Mesh


def read_obj(path: PathLike) -> Mesh:
    """Read an OBJ file; see the module for what is done where files differ.

    Every coordinate is the float64 nearest to its text. The arrays `uvs` and `normals` are those of
    the file, in its order, and so are the faces.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        A line breaks the format, or nothing in the file is of it.
    MeshError
        There are no faces, or a coordinate is not finite.
    """
    data = map_file(path)
    require_text(path, data, "an OBJ file")
    lines = find_lines(data)
    if len(lines[V]) == 0:
        raise FileFormatError(f"{path}: it is not an OBJ file; no line of it is a vertex (v)")
    if len(lines[F]) == 0:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    positions, n_words = read_values(path, data, lines, V, 3)
    sizes, corners = read_corners(path, data, lines)
    fields: dict[str, Any] = {"positions": positions, "name": Path(path).name}
    if n_words.max() >= 6:
        fields["colors"] = _read_colors(path, data, lines, n_words)

    slots, polygons = None, None
    if (sizes != 3).any():
        slots, polygons = fan_corners(sizes)
    for part, (values, corner_name, width) in enumerate(
        (("positions", "faces", 3), ("uvs", "uv_faces", 2), ("normals", "normal_faces", 3))
    ):
        indices = corners[part]
        if part > 0:
            if (indices < 0).all():
                continue
            array, _ = read_values(path, data, lines, part, width)
            fields[values], indices = _completed(array, indices)
        fields[corner_name] = indices.reshape(-1, 3) if slots is None else indices[slots]
    groups, names = _read_groups(data, lines)
    if names:
        fields |= {
            "face_groups": groups if polygons is None else groups[polygons],
            "group_names": names,
        }
    return Mesh(**fields)


def _read_colors(
    path: PathLike, data: ByteArray, lines: Lines, n_words: IntArray
) -> npt.NDArray[np.float32]:
    """(V, 3), or (V, 4) with alpha: colors behind the positions, white where there is none."""
    width = 4 if n_words.max() >= 7 else 3
    colors = read_values(path, data, lines, V, 3 + width)[0][:, 3:]
    colors[n_words < 6] = 1.0
    colors[n_words == 6, 3:] = 1.0
    return unit_colors(path, colors)


def _completed(values: FloatArray, corners: IntArray) -> tuple[FloatArray, IntArray]:
    """Add a zero row for the corners that have no index, where there are any."""
    missing = corners < 0
    if not missing.any():
        return values, corners
    return (
        np.concatenate([values, np.zeros((1, values.shape[1]))]),
        np.where(missing, np.int32(len(values)), corners),
    )


_MARK = re.compile(rb"(o|g|usemtl)\b[^\S\r\n]*([^\r\n]*)")


def _read_groups(data: ByteArray, lines: Lines) -> tuple[IntArray, tuple[str, ...]]:
    """Group of each polygon and the names of those that have one, in order of appearance."""
    befores = np.searchsorted(lines[F], lines[MARK]).tolist()
    marks = [
        (match[1], match[2].strip(), start)
        for at, start in zip(lines[MARK].tolist(), befores, strict=True)
        if (match := _MARK.match(data.data, at))
    ]
    n_polygons = len(lines[F])
    groups = np.zeros(n_polygons, dtype=np.int32)
    if not marks:
        return groups, ()
    by_material = all(keyword == b"usemtl" for keyword, _, _ in marks)
    parts = [b"usemtl"] if by_material else [b"o", b"g"]
    ids: dict[str, int] = {"default": 0} if marks[0][2] > 0 else {}
    current: dict[bytes, bytes] = {}
    stops = [start for _, _, start in marks[1:]]
    for (keyword, name, start), stop in zip(marks, [*stops, n_polygons], strict=True):
        if keyword == b"o":
            current.pop(b"g", None)
        current[keyword] = name
        if stop > start:
            set_names = dict.fromkeys(current[part] for part in parts if current.get(part))
            full = decode_name(b"/".join(set_names)) or "default"
            groups[start:stop] = ids.setdefault(full, len(ids))
    return groups, tuple(ids)
