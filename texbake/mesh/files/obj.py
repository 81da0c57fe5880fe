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

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mesh.files.decimals import decimal_kernel, read_word
from texbake.mesh.files.polygons import fan_corners
from texbake.mesh.files.source import (
    ByteArray,
    decode_name,
    line_number,
    map_file,
    require_text,
)
from texbake.mesh.mesh import FloatArray, IntArray, Mesh

# Slots of the kernel's tally.
_V, _VT, _VN, _POLYGONS, _CORNERS, _MARKS, _WIDEST, _HARD, _WITH_UV, _WITH_NORMAL = range(10)
_N_SLOTS = 10
# What the kernel found wrong.
_FEW_VALUES, _FEW_CORNERS, _BAD_CORNER, _OUT_OF_RANGE = range(1, 5)
_COMPLAINTS = {
    _FEW_VALUES: "too few numbers; v and vn need three, vt one",
    _FEW_CORNERS: "a face of fewer than three corners",
    _BAD_CORNER: "a corner that is none of v, v/vt, v//vn, v/vt/vn with whole numbers",
    _OUT_OF_RANGE: "an index out of range; they begin at 1 (or at -1, backwards) "
    "and end at the number of v, vt or vn lines",
}


class _Arrays(NamedTuple):
    """What the kernel fills, sized after its first walk."""

    values: tuple[FloatArray, FloatArray, FloatArray]  # (V, 3), (T, 2), (N, 3) of v, vt and vn
    colors: FloatArray  # (V, 4), or (0, 4) in a file without
    corners: IntArray  # (3, C): indices of v, vt and vn, -1 where there is none
    sizes: IntArray  # (P,): corners of each polygon
    marks: npt.NDArray[np.int64]  # (M, 2): offset of each g, o or usemtl line; polygons before it
    hard: npt.NDArray[np.int64]  # (H, 4): kind, row, column (from 3: color) and offset of a number


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
    tally = np.zeros(_N_SLOTS, dtype=np.int64)
    _walk(path, data, tally, _arrays(tally), fill=False)
    if tally[_V] == 0:
        raise FileFormatError(f"{path}: it is not an OBJ file; no line of it is a vertex (v)")
    if tally[_POLYGONS] == 0:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    if max(tally) > np.iinfo(np.int32).max:
        raise FileFormatError(f"{path}: it is too large; indices must fit 32 bits")
    arrays = _arrays(tally)
    _walk(path, data, tally, arrays, fill=True)
    if tally[_HARD] > len(arrays.hard):  # more than there was room for; now it is known how many
        arrays = arrays._replace(hard=np.empty((tally[_HARD], 4), dtype=np.int64))
        _walk(path, data, tally, arrays, fill=True)
    for kind, row, column, at in arrays.hard[: tally[_HARD]].tolist():
        value = read_word(path, data, at)
        if column < 3:
            arrays.values[kind][row, column] = value
        else:
            arrays.colors[row, column - 3] = value
    return _assemble(path, data, tally, arrays)


def _arrays(tally: npt.NDArray[np.int64]) -> _Arrays:
    return _Arrays(
        values=(np.empty((tally[_V], 3)), np.zeros((tally[_VT], 2)), np.empty((tally[_VN], 3))),
        colors=np.ones((tally[_V] if tally[_WIDEST] >= 6 else 0, 4)),
        corners=np.empty((3, tally[_CORNERS]), dtype=np.int32),
        sizes=np.empty(tally[_POLYGONS], dtype=np.int32),
        marks=np.empty((tally[_MARKS], 2), dtype=np.int64),
        hard=np.empty((1024, 4), dtype=np.int64),
    )


def _walk(
    path: PathLike,
    data: ByteArray,
    tally: npt.NDArray[np.int64],
    arrays: _Arrays,
    *,
    fill: bool,
) -> None:
    complaint, at = _walk_kernel(data, fill, tally, *arrays)
    if complaint:
        raise FileFormatError(f"{path}: line {line_number(data, at)}: {_COMPLAINTS[complaint]}")


def _assemble(
    path: PathLike, data: ByteArray, tally: npt.NDArray[np.int64], arrays: _Arrays
) -> Mesh:
    positions, uvs, normals = arrays.values
    slots, polygons = None, None
    if (arrays.sizes != 3).any():
        slots, polygons = fan_corners(arrays.sizes)

    def triangles(indices: IntArray) -> IntArray:
        return indices.reshape(-1, 3) if slots is None else indices[slots]

    fields: dict[str, Any] = {}
    if tally[_WITH_UV]:
        uvs, corners = _completed(uvs, arrays.corners[1])
        fields |= {"uvs": uvs, "uv_faces": triangles(corners)}
    if tally[_WITH_NORMAL]:
        normals, corners = _completed(normals, arrays.corners[2])
        fields |= {"normals": normals, "normal_faces": triangles(corners)}
    if len(arrays.colors):
        fields["colors"] = _colors(path, arrays.colors, 4 if tally[_WIDEST] >= 7 else 3)
    groups, names = _groups(data, arrays.marks, len(arrays.sizes))
    if names:
        fields |= {
            "face_groups": groups if polygons is None else groups[polygons],
            "group_names": names,
        }
    return Mesh(
        positions=positions,
        faces=triangles(arrays.corners[0]),
        name=Path(path).name,
        **fields,
    )


def _completed(
    values: FloatArray, corners: IntArray
) -> tuple[FloatArray, IntArray]:
    """Add a zero row for the corners that have no index, where there are any."""
    missing = corners < 0
    if not missing.any():
        return values, corners
    return (
        np.concatenate([values, np.zeros((1, values.shape[1]))]),
        np.where(missing, np.int32(len(values)), corners),
    )


def _colors(path: PathLike, colors: FloatArray, width: int) -> npt.NDArray[np.float32]:
    colors = colors[:, :width]
    if not np.isfinite(colors).all():
        raise MeshError(f"{path}: a vertex color is not finite")
    if colors.max() > 1.0 and (colors == np.round(colors)).all():
        colors = colors / 255.0
    return colors.astype(np.float32)


_MARK = re.compile(rb"(\w+)[^\S\r\n]*([^\r\n]*)")


def _groups(
    data: ByteArray, marks: npt.NDArray[np.int64], n_polygons: int
) -> tuple[IntArray, tuple[str, ...]]:
    """Group of each polygon and the names of those that have one, in order of appearance."""
    groups = np.zeros(n_polygons, dtype=np.int32)
    if len(marks) == 0:
        return groups, ()
    text = memoryview(data)
    words = [match.groups() for at in marks[:, 0].tolist() if (match := _MARK.match(text, at))]
    by_material = all(keyword == b"usemtl" for keyword, _ in words)
    parts = [b"usemtl"] if by_material else [b"o", b"g"]
    starts = marks[:, 1].tolist()
    ids: dict[str, int] = {"default": 0} if starts[0] > 0 else {}
    current: dict[bytes, bytes] = {}
    for (keyword, name), start, stop in zip(
        words, starts, [*starts[1:], n_polygons], strict=True
    ):
        if keyword == b"o":
            current.pop(b"g", None)
        current[keyword] = name.strip()
        if stop > start:
            set_names = dict.fromkeys(current[part] for part in parts if current.get(part))
            full = decode_name(b"/".join(set_names)) or "default"
            groups[start:stop] = ids.setdefault(full, len(ids))
    return groups, tuple(ids)


@njit(nogil=True, cache=True, inline="always")
def _skip_blanks_kernel(data, at):  # type: ignore[no-untyped-def]
    """Offset of the next word of a statement, or of its end; a backslash continues the line."""
    while at < len(data):
        byte = data[at]
        if byte == 92 and at + 1 < len(data) and (data[at + 1] == 10 or data[at + 1] == 13):
            at += 3 if data[at + 1] == 13 and at + 2 < len(data) and data[at + 2] == 10 else 2
        elif byte <= 32 and byte != 10 and byte != 13:
            at += 1
        else:
            break
    return at


@njit(nogil=True, cache=True, inline="always")
def _ends_kernel(data, at):  # type: ignore[no-untyped-def]
    """Whether a statement has no more words: at the end of the line, or before a comment."""
    return at >= len(data) or data[at] == 10 or data[at] == 13 or data[at] == 35


@njit(nogil=True, cache=True)
def _corner_kernel(data, at, tally, totals, corners, slot):  # type: ignore[no-untyped-def]
    """Read one corner ``v/vt/vn`` into its slot; returns a complaint, or 0, and the end."""
    for part in range(3):
        backwards = at < len(data) and data[at] == 45
        at += backwards
        index, n_digits = 0, 0
        while at < len(data) and 48 <= data[at] <= 57:
            index = min(index * 10 + data[at] - 48, 1 << 40)
            n_digits += 1
            at += 1
        if n_digits == 0:
            corners[part, slot] = -1
            if part == 0 or backwards:
                return _BAD_CORNER, at
        else:
            index = tally[part] - index if backwards else index - 1
            if index < 0 or index >= totals[part]:
                return _OUT_OF_RANGE, at
            corners[part, slot] = index
        if at < len(data) and data[at] == 47 and part < 2:  # /
            at += 1
        else:
            for rest in range(part + 1, 3):
                corners[rest, slot] = -1
            break
    if at < len(data) and data[at] > 32 and data[at] != 92:
        return _BAD_CORNER, at
    return 0, at


@njit(nogil=True, cache=True)
def _face_kernel(data, at, fill, tally, totals, corners):  # type: ignore[no-untyped-def]
    """Read the corners of an f line; returns how many, a complaint, or 0, and the offset."""
    n_words = 0
    while True:
        at = _skip_blanks_kernel(data, at)
        if _ends_kernel(data, at):
            return n_words, 0, at
        if fill:
            word = at
            slot = tally[_CORNERS] + n_words
            complaint, at = _corner_kernel(data, at, tally, totals, corners, slot)
            if complaint:
                return n_words, complaint, word
            tally[_WITH_UV] += corners[1, slot] >= 0
            tally[_WITH_NORMAL] += corners[2, slot] >= 0
        else:
            while at < len(data) and data[at] > 32 and data[at] != 92:
                at += 1
        n_words += 1


@njit(nogil=True, cache=True)
def _values_kernel(data, at, fill, kind, tally, values, colors, hard):  # type: ignore[no-untyped-def]
    """Read the numbers of a v, vt or vn line; returns how many there are, and the offset."""
    row, n_hard = tally[kind], tally[_HARD]
    n_words = 0
    while True:
        at = _skip_blanks_kernel(data, at)
        if _ends_kernel(data, at):
            break
        if fill:
            word = at
            value, at = decimal_kernel(data, at, len(data))
            used = True
            if n_words < values.shape[1]:
                values[row, n_words] = value
            elif kind == _V and len(colors) > 0 and n_words < 7:
                colors[row, n_words - 3] = value
            else:
                used = False
            if used and math.isnan(value):
                if n_hard < len(hard):
                    hard[n_hard, 0], hard[n_hard, 1] = kind, row
                    hard[n_hard, 2], hard[n_hard, 3] = n_words, word
                n_hard += 1
            if n_words < 3:
                tally[_HARD] = n_hard
        else:
            while at < len(data) and data[at] > 32 and data[at] != 92:
                at += 1
        n_words += 1
    if n_words >= 6:
        tally[_HARD] = n_hard
    elif kind == _V and len(colors) > 0:
        colors[row] = 1.0  # a weight is no color
    return n_words, at


@njit(nogil=True, cache=True)
def _kind_kernel(data, at):  # type: ignore[no-untyped-def]
    """Tally slot of the statement that begins at an offset, or -1, and where its keyword ends."""
    first = data[at]
    second = data[at + 1] if at + 1 < len(data) else 10
    third = data[at + 2] if at + 2 < len(data) else 10
    if second <= 32:
        if first == 118:  # v
            return _V, at + 1
        if first == 102:  # f
            return _POLYGONS, at + 1
        if first == 103 or first == 111:  # g, o
            return _MARKS, at
    if first == 118 and third <= 32:
        if second == 116:  # vt
            return _VT, at + 2
        if second == 110:  # vn
            return _VN, at + 2
    if first == 117 and second == 115 and third == 101 and at + 6 < len(data):
        if data[at + 3] == 109 and data[at + 4] == 116 and data[at + 6] <= 32:  # usemtl
            return _MARKS, at
    return -1, at


@njit(nogil=True, cache=True)
def _walk_kernel(data, fill, tally, values, colors, corners, sizes, marks, hard):  # type: ignore[no-untyped-def]
    """Walk all statements: count them into `tally`, or with `fill` read them into the arrays.

    Returns a complaint, or 0, and the offset that it is about.
    """
    totals = tally.copy()
    tally[:] = 0
    at = 3 if len(data) > 2 and data[0] == 0xEF and data[1] == 0xBB and data[2] == 0xBF else 0
    while True:
        at = _skip_blanks_kernel(data, at)
        if at >= len(data):
            return 0, at
        line = at
        kind, at = _kind_kernel(data, at)
        if kind == _POLYGONS:
            n_words, complaint, at = _face_kernel(data, at, fill, tally, totals, corners)
            if complaint:
                return complaint, at
            if n_words < 3:
                return _FEW_CORNERS, line
            if fill:
                sizes[tally[_POLYGONS]] = n_words
            tally[_CORNERS] += n_words
        elif kind == _MARKS:
            if fill:
                marks[tally[_MARKS], 0], marks[tally[_MARKS], 1] = line, tally[_POLYGONS]
        elif kind >= 0:
            n_words, at = _values_kernel(data, at, fill, kind, tally, values[kind], colors, hard)
            if n_words < (1 if kind == _VT else 3):
                return _FEW_VALUES, line
            if kind == _V:
                tally[_WIDEST] = max(tally[_WIDEST], n_words)
        if kind >= 0:
            tally[kind] += 1
        while at < len(data) and data[at] != 10 and data[at] != 13:
            at += 1
        at += 1
