"""Reading Wavefront OBJ.

Based on: Wavefront Technologies, "Object Files (.obj)", appendix B1 of the Advanced Visualizer
manual; vertex colors ``v x y z r g b`` as MeshLab and ZBrush write them.

Where the format leaves a choice, or files differ, this holds:

- For polygons see `texbake.mesh.polygons`. Faces with fewer than three corners are left out.
- A face belongs to its object and group, named ``object/group``, or by one name if only one is set
  or both are equal; a new ``o`` ends the group before it. The rest of the line is the name,
  including spaces. If a file has neither ``o`` nor ``g``, its materials are the groups. Faces
  before the first group belong to the group ``default``.
- If only some corners have ``vt``, the others share one more coordinate at (0, 0), so that their
  faces cover no area of the texture. If only some have ``vn``, the others get a zero normal, and
  shading uses a computed one instead.
- A fourth value of ``v`` is a weight and is dropped; with six or seven values, the values from the
  fourth on are a color. If all colors are whole numbers and one is above 1, they are divided by
  255. If only some vertices have a color, the others are white.
- Smoothing groups count if no corner has ``vn``; see `texbake.mesh.hard_edges`. Faces before
  the first ``s`` have none, as with ``s off`` and ``s 0``.
- Lines, points, curves and unknown statements are skipped.
- Numbers with decimal commas are read if spaces separate them.

Kernel: `core/obj_rows.c`.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from texbake.core import core
from texbake.errors import FileFormatError, MeshError, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import finite_rows, finite_vertices, unit_colors
from texbake.mesh.files.obj_write import read_uv_sets
from texbake.mesh.files.source import (
    POWERS_OF_FIVE,
    decode_name,
    line_number,
    read_array,
    read_word,
    text_of,
)
from texbake.mesh.hard_edges import Polygons, with_smoothing_groups
from texbake.mesh.mesh import ByteArray, Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.polygons import triangulated
from texbake.parallel import run_bands

# Kinds of statements, each with its own list of lines; a mark is g, o, s or usemtl.
V, VT, VN, F, MARK = range(5)
_OUT_OF_RANGE = -2  # written in the place of a position index


def read_obj(path: PathLike) -> Mesh:
    """Read an OBJ file, each number as the nearest float64, each array in the file's order."""
    data = read_obj_text(path)
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

    slots, polygons = (
        triangulated(path, positions, corners[0], sizes) if (sizes != 3).any() else (None, None)
    )
    for part, (values, corner_name, width) in enumerate(
        (("positions", "faces", 3), ("uvs", "uv_faces", 2), ("normals", "normal_faces", 3))
    ):
        indices = corners[part]
        if part > 0:
            if (indices < 0).all():
                continue
            array, _ = read_values(path, data, lines, part, width)
            array = finite_rows(path, array, values)
            missing = indices < 0
            if missing.any():  # corners without an index share one more row, of zeros
                array = np.concatenate([array, np.zeros((1, width))])
                indices = np.where(missing, np.int32(len(array) - 1), indices)
            fields[values] = array
        fields[corner_name] = indices.reshape(-1, 3) if slots is None else indices[slots]
    fields["polygon_of"] = polygons
    marks = read_marks(data, lines)
    groups, names, objects = _read_groups(marks, len(sizes))
    if names:
        fields |= {
            "face_groups": groups if polygons is None else groups[polygons],
            "group_names": names,
            "group_objects": objects,
        }
    uv_sets = read_uv_sets(path, fields["faces"])
    fields["positions"], fields["faces"], fields["colors"] = finite_vertices(
        path, positions, fields["faces"], fields.get("colors")
    )
    bad = np.flatnonzero(~np.isfinite(fields["positions"]).all(axis=1))
    if len(bad):
        line = line_number(data, int(lines[V][bad[0]]))
        raise MeshError(f"{path}: line {line}: a coordinate is not finite")
    mesh = Mesh(**fields, uv_sets=uv_sets)
    smoothing = _smoothing_groups(marks, len(sizes))
    if mesh.normals is not None or smoothing is None:
        return mesh
    return with_smoothing_groups(mesh, Polygons.of(corners[0], sizes), slots, smoothing)


def read_obj_text(path: PathLike) -> ByteArray:
    """Read the text of an OBJ file; raises what `text_of` and `read_array` raise."""
    return text_of(path, read_array(path), "an OBJ file")


def _read_colors(path: PathLike, data: ByteArray, lines: Lines, n_words: IntArray) -> Float32Array:
    """(V, 3), or (V, 4) with alpha: colors behind the positions, white where there is none."""
    width = 4 if n_words.max() >= 7 else 3
    values = read_values(path, data, lines, V, 3 + width)[0]
    colors, has_color = np.ones((len(values), width), np.float32), n_words >= 6
    colors[has_color] = unit_colors(path, values[has_color, 3:])
    colors[n_words == 6, 3:] = 1.0
    return colors


_MARK = re.compile(rb"(o|g|s|usemtl)\b[^\S\r\n]*([^\r\n]*)")
_Mark = tuple[bytes, bytes, int]  # its keyword, what follows, and the polygon that comes next


def read_marks(data: ByteArray, lines: Lines) -> list[_Mark]:
    """Statements of groups, objects, smoothing groups and materials, in their order."""
    befores = np.searchsorted(lines[F], lines[MARK]).tolist()
    return [
        (match[1], match[2].strip(), start)
        for at, start in zip(lines[MARK].tolist(), befores, strict=True)
        if (match := _MARK.match(data.data, at))
    ]


def _smoothing_groups(marks: list[_Mark], n_polygons: int) -> IntArray | None:
    """Smoothing group of each polygon, 0 for none; None where no statement sets one."""
    ids: dict[bytes, int] = dict.fromkeys((b"", b"0", b"off"), 0)
    groups = np.zeros(n_polygons, np.int32) if any(mark[0] == b"s" for mark in marks) else None
    for keyword, name, start in marks:
        if keyword == b"s" and groups is not None:
            word = name.partition(b"#")[0].strip().lower()
            groups[start:] = ids.setdefault(word, len(ids))
    return groups


def _read_groups(
    all_marks: list[_Mark], n_polygons: int
) -> tuple[IntArray, tuple[str, ...], tuple[int, ...]]:
    """Group of each polygon, and the names and objects of groups, in order of appearance."""
    marks = [mark for mark in all_marks if mark[0] != b"s"]
    groups = np.zeros(n_polygons, dtype=np.int32)
    if not marks:
        return groups, (), ()
    by_material = all(keyword == b"usemtl" for keyword, _, _ in marks)
    parts = [b"usemtl"] if by_material else [b"o", b"g"]
    ids: dict[str, int] = {"default": 0} if marks[0][2] > 0 else {}
    objects = dict.fromkeys(ids, b"")
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
            objects.setdefault(full, current.get(b"o", b""))
    if by_material or len(ids) < 2:
        return groups, tuple(ids), ()
    numbers = {name: number for number, name in enumerate(dict.fromkeys(objects.values()))}
    if len(numbers) == 1:
        return groups, tuple(ids), tuple(range(len(ids)))
    return groups, tuple(ids), tuple(numbers[name] for name in objects.values())


Lines = tuple[Int64Array, ...]  # one list of offsets a kind
_KEYWORDS = ("v", "vt", "vn", "f")
_BAND = 1 << 15  # lines

# A number with a comma that separates neither two values nor thousands.
_DECIMAL_COMMA = re.compile(rb"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
# A word after blanks; a backslash continues a statement on the next line.
_WORD = re.compile(rb"(?:\\(?:\r\n|\r|\n)?|[\x00-\x09\x0b\x0c\x0e-\x20])*([^\x00-\x20\\]+)")


def find_lines(data: ByteArray) -> Lines:
    """Offsets of the statements of each kind: behind the keyword, at it for marks."""
    counts = np.zeros(5, dtype=np.int64)
    core.find_statements(data, False, counts, np.empty(0, dtype=np.int64))
    ends = np.cumsum(counts)
    offsets = np.empty(ends[-1], dtype=np.int64)
    core.find_statements(data, True, ends - counts, offsets)
    return tuple(np.split(offsets, ends[:-1]))


def read_values(
    path: PathLike, data: ByteArray, lines: Lines, kind: int, width: int
) -> tuple[FloatArray, IntArray]:
    """(n, width) numbers of v, vt or vn lines, 0 where missing, and (n,) counts of words."""
    values, n_words = _walk_lines(data, lines[kind], width)
    if np.isnan(values).any():
        row, column = np.argwhere(np.isnan(values))[0].tolist()
        start, stop = _column_at(data, int(lines[kind][row]), column)
        if _DECIMAL_COMMA.fullmatch(data[start:stop].tobytes()):
            warn_of(path, "decimal commas are read as decimal points")
            data = np.where(data == ord(","), np.uint8(ord(".")), data)
            values, n_words = _walk_lines(data, lines[kind], width)
    least = 1 if kind == VT else 3
    if (n_words < least).any():
        line = line_number(data, int(lines[kind][int((n_words < least).argmax())]))
        raise FileFormatError(
            f"{path}: line {line}: too few numbers; {_KEYWORDS[kind]} needs {least}"
        )
    for row, column in np.argwhere(np.isnan(values)).tolist():
        at = _column_at(data, int(lines[kind][row]), column)[0]
        values[row, column] = read_word(path, data, at)
    return values, n_words


def _column_at(data: ByteArray, at: int, column: int) -> tuple[int, int]:
    """Where the word with a number begins and ends in a statement."""
    for _ in range(column):
        at = _word_at(data, at)[1]
    return _word_at(data, at)


def _word_at(data: ByteArray, at: int) -> tuple[int, int]:
    """Where the next word of a statement begins and ends."""
    found = _WORD.match(data.data, at)
    return found.span(1) if found else (at, at)


def _walk_lines(data: ByteArray, starts: Int64Array, width: int) -> tuple[FloatArray, IntArray]:
    values = np.zeros((len(starts), width))
    n_words = np.empty(len(starts), dtype=np.int32)
    run_bands(
        lambda start, stop: core.read_rows(
            data, starts, start, stop, POWERS_OF_FIVE, values, n_words
        ),
        len(starts),
        band=_BAND,
    )
    return values, n_words


def polygon_sizes(data: ByteArray, lines: Lines) -> IntArray:
    """(P,) number of corners of each polygon."""
    return _walk_lines(data, lines[F], 0)[1]


def read_corners(path: PathLike, data: ByteArray, lines: Lines) -> tuple[IntArray, IntArray]:
    """(P,) corners of each polygon, and (3, C) their indices of v, vt and vn, -1 for none."""
    starts = lines[F]
    sizes = polygon_sizes(data, lines)
    ends = np.cumsum(sizes, dtype=np.int64)
    if max(ends[-1], *(len(lines[kind]) for kind in (V, VT, VN))) > np.iinfo(np.int32).max:
        raise FileFormatError(f"{path}: it is too large; indices must fit 32 bits")
    corners = np.empty((3, int(ends[-1])), dtype=np.int32)
    run_bands(
        lambda start, stop: core.read_corners(
            data, starts, start, stop, ends, lines[V], lines[VT], lines[VN], corners
        ),
        len(starts),
        band=_BAND,
    )
    bad = corners[0] < 0
    if bad.any():
        slot = int(bad.argmax())
        line = line_number(data, int(starts[int(np.searchsorted(ends, slot, side="right"))]))
        what = (
            "an index is out of range; they begin at 1, or at -1 backwards"
            if corners[0, slot] == _OUT_OF_RANGE
            else "a corner is none of v, v/vt, v//vn, v/vt/vn with whole numbers"
        )
        raise FileFormatError(f"{path}: line {line}: {what}")
    return sizes, corners
