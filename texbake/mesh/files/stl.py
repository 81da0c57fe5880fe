"""Reading and writing STL, binary and ASCII.

Based on: 3D Systems, "StereoLithography Interface Specification", 1988.

STL has no vertices of its own, only corners of triangles. Corners at exactly one place, bit for bit
(0.0 and -0.0 are one), become one vertex; triangles without area stay. The normals of the facets
are not read, because they follow from the corners.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, MeshError, counted, quoted, warn_of
from texbake.files import PathLike, replacing
from texbake.mesh.files.conversion import float32_positions
from texbake.mesh.files.source import decode_name, parse_numbers, read_array, text_of
from texbake.mesh.mesh import ByteArray, FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.weld import unique_rows

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
HEADER_SIZE = 80


def read_stl(path: PathLike) -> Mesh:
    """Read an STL file; the solids of an ASCII file become groups."""
    data = read_array(path)
    groups: IntArray | None = None
    names: tuple[str, ...] = ()
    n_triangles = binary_count(data)
    body = data[HEADER_SIZE + 4 :]
    n_more = len(body) - (n_triangles or 0) * RECORD.itemsize
    if n_triangles is not None and n_more >= 0 and (n_triangles > 0 or n_more == 0):
        # Tested first, because many binary files begin with the word solid too. A text file would
        # have hundreds of millions of triangles here, and fail the test.
        if n_more:
            warn_of(path, f"left out {counted(n_more, 'byte')} after the last triangle")
        records = np.ndarray(n_triangles, RECORD, buffer=body.data)
        corners: npt.NDArray[np.floating] = records["corners"].reshape(-1, 3)
    elif data[:512].tobytes().lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid":
        corners, groups, names = _read_ascii(path, data)
    else:
        raise FileFormatError(
            f"{path}: it is not an STL file, or it is truncated: it neither begins with 'solid' "
            f"nor does its length fit its number of triangles"
        )
    if len(corners) == 0:
        raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
    if not np.isfinite(corners).all():
        raise MeshError(f"{path}: a position is not finite")
    kept, vertices = unique_rows(corners)
    return Mesh(
        positions=corners[kept].astype(np.float64),
        faces=vertices.reshape(-1, 3),
        face_groups=groups,
        group_names=names,
        name=Path(path).name,
    )


def binary_count(data: ByteArray) -> int | None:
    """Number of triangles that a binary file says it has; None for a file too short to say."""
    count = data[HEADER_SIZE : HEADER_SIZE + 4].tobytes()
    return int.from_bytes(count, "little") if len(count) == 4 else None


# An end of line, then the keyword; "endsolid" does not match.
_SOLID = re.compile(rb"(?:\A|[\r\n])[ \t]*solid\b([^\r\n]*)", re.IGNORECASE)
_END = re.compile(rb"[\r\n][ \t]*endsolid\b[^\r\n]*\s*\Z", re.IGNORECASE)


def _read_ascii(
    path: PathLike, data: ByteArray
) -> tuple[FloatArray, IntArray | None, tuple[str, ...]]:
    """(3F, 3) corners, the solid of each triangle, and the solids' names."""
    data = text_of(path, data, "an STL file")
    if not _END.search(data[-4096:].data):
        raise FileFormatError(f"{path}: it does not end with 'endsolid'; it is truncated")
    solids = [(match.end(), decode_name(match[1].strip())) for match in _SOLID.finditer(data.data)]
    if not solids:
        raise FileFormatError(f"{path}: it is not an STL file; it has no line 'solid'")
    pieces, groups = [], []
    ids: dict[str, int] = {}
    stops = [start for start, _ in solids[1:]]
    for (start, name), stop in zip(solids, [*stops, len(data)], strict=True):
        values, lines = parse_numbers(path, data, start, stop, lead="v")
        sizes = np.diff(lines, append=len(values))
        if len(lines) % 3 or (sizes != 3).any():
            raise FileFormatError(
                f"{path}: solid {quoted(name)}: {len(lines)} vertex lines with {len(values)} "
                "numbers make no whole triangles; the file is damaged"
            )
        pieces.append(values.reshape(-1, 3))
        if len(lines):
            groups.append(np.full(len(lines) // 3, ids.setdefault(name, len(ids)), dtype=np.int32))
    corners = np.concatenate(pieces)
    if set(ids) <= {""}:
        return corners, None, ()
    return corners, np.concatenate(groups), tuple(name or "default" for name in ids)


def write_stl(mesh: Mesh, path: PathLike) -> None:
    """Write a binary STL file: corners as float32 and face normals, and nothing else."""
    points = float32_positions(mesh, np.zeros(3))
    records = np.zeros(mesh.n_faces, dtype=RECORD)
    records["normal"] = face_normals(mesh)
    records["corners"] = points[mesh.faces]
    with replacing(path) as temporary, temporary.open("wb") as file:
        # The first word must not be solid, for many readers take that for the ASCII form.
        file.write(b"binary STL".ljust(HEADER_SIZE))
        file.write(mesh.n_faces.to_bytes(4, "little"))
        file.write(records.tobytes())
