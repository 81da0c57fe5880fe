"""Mesh files that can be read in chunks: binary PLY and binary STL.

A PLY file can if its vertices have rows of one size and come before its faces, and if the corners
of its faces have no values of their own. Other files are read as a whole. The file is mapped, and
positions are read where they are needed.

Kernel: `core/streamed_vertices.c`.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import FileError, FileFormatError, MeshError, warn_of
from texbake.files import PathLike, require_file
from texbake.mesh.files import ply, stl
from texbake.mesh.files.ply_tables import (
    Columns,
    Element,
    Header,
    read_element,
    read_header,
    require_rows,
)
from texbake.mesh.mesh import ByteArray, FloatArray, Int64Array, IntArray
from texbake.mesh.polygons import triangulated
from texbake.parallel import run_bands
from texbake.records import dataclass

# Rows that are read at once.
ROWS_PER_BLOCK = 1 << 19
_VERTICES_PER_BAND = 1 << 18  # a multiple of 64: a word of bits is written by one band
_WORD = 64
# Vertices that are read between two releases: they may be spread over much of the file.
_AT_ONCE = 1 << 20
# Bits of the table of hashes for each position in it, of which three are set: about 1 vertex in 200
# is marked for nothing.
_BITS_PER_POSITION = 16

Words = npt.NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class MappedFile:
    """The bytes of a file, read from it where they are touched."""

    path: PathLike  # for messages
    data: ByteArray  # (n_bytes,) uint8; read-only
    pages: mmap.mmap  # the mapping that `data` is a view of

    def release(self) -> None:
        """Let the pages that were read count no longer as memory of this process."""
        if hasattr(mmap, "MADV_DONTNEED"):
            self.pages.madvise(mmap.MADV_DONTNEED)


def map_file(path: PathLike) -> MappedFile:
    """Map a file into memory."""
    require_file(path)
    try:
        with Path(path).open("rb") as file:
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError as error:
        raise FileFormatError(f"{path}: the file is empty") from error
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    return MappedFile(path, np.frombuffer(pages, dtype=np.uint8), pages)


@dataclass(frozen=True, eq=False)
class FileVertices:
    """Positions of vertices in the bytes of a file."""

    file: MappedFile
    n: int  # number of vertices
    layout: Int64Array  # (9,) int64; where they are; see `core/streamed_vertices.c`

    def read(self, vertices: IntArray, threads: int | None = None) -> FloatArray:
        """Positions of some vertices: (n, 3) float64."""
        data, positions = self.file.data, np.empty((len(vertices), 3))
        for first in range(0, len(vertices), _AT_ONCE):

            def read(start: int, stop: int, first: int = first) -> None:
                some = slice(first + start, first + stop)
                core.read_vertices(data, self.layout, vertices[some], 0, positions[some])

            n = min(_AT_ONCE, len(vertices) - first)
            run_bands(read, n, band=1 << 16, threads=threads)
            if n == _AT_ONCE:
                self.file.release()
        return positions

    def of_faces(self, faces: IntArray, threads: int | None = None) -> tuple[FloatArray, IntArray]:
        """Return positions that have all corners of faces, and the faces as indices into them."""
        if len(faces) == 0:
            return np.empty((0, 3)), faces
        first, last = int(faces.min()), int(faces.max())
        if last - first >= faces.size:
            corners = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
            return self.read(faces.reshape(-1), threads), corners
        data, positions = self.file.data, np.empty((last - first + 1, 3))

        def read(start: int, stop: int) -> None:
            core.read_vertices(data, self.layout, None, first + start, positions[start:stop])

        run_bands(read, len(positions), band=1 << 16, threads=threads)
        return positions, faces - np.int32(first)

    def not_finite(self, threads: int | None) -> Marks | None:
        """Mark the vertices that are not finite; None if all are."""
        bad: list[int] = []

        def find(start: int, stop: int) -> None:
            while (found := core.find_not_finite(self.file.data, self.layout, start, stop)) >= 0:
                bad.append(found)
                start = found + 1

        run_bands(find, self.n, band=_VERTICES_PER_BAND, threads=threads)
        self.file.release()
        return Marks.of(np.array(bad, np.int32), self.n) if bad else None

    def at(self, positions: FloatArray, threads: int | None) -> Marks:
        """Mark all vertices that lie at some positions, and a few others."""
        n_bits = _WORD
        while n_bits < _BITS_PER_POSITION * len(positions):
            n_bits *= 2
        table = np.zeros(n_bits // _WORD, dtype=np.uint64)
        core.set_hashes(positions, table)
        bits = _no_bits(self.n)

        def mark(start: int, stop: int) -> None:
            core.mark_by_hash(self.file.data, self.layout, table, start, stop, bits)

        run_bands(mark, self.n, band=_VERTICES_PER_BAND, threads=threads)
        self.file.release()
        return Marks.of_bits(bits)


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks of some vertices or faces, which number them in the order of the file."""

    bits: Words  # one bit for each place
    ranks: IntArray  # how many bits are set before each word of 64
    places: IntArray  # (n,) int32; the marked ones, in ascending order

    @classmethod
    def of_bits(cls, bits: Words) -> Marks:
        """Number the marks."""
        ranks = np.empty(len(bits), dtype=np.int32)
        places = np.empty(core.rank_bits(bits, ranks), dtype=np.int32)
        core.list_bits(bits, places)
        return cls(bits, ranks, places)

    @classmethod
    def of(cls, places: IntArray, n_places: int) -> Marks:
        """Mark some places, such as the corners of faces."""
        bits = _no_bits(n_places)
        core.set_bits(places.reshape(-1), bits)
        return cls.of_bits(bits)

    def numbers_of(self, places: IntArray, threads: int | None = None) -> IntArray:
        """Which mark each of some places is, -1 for none and for places below 0."""
        flat, numbers = places.reshape(-1), np.empty_like(places)
        out = numbers.reshape(-1)

        def work(start: int, stop: int) -> None:
            core.number_marks(flat[start:stop], self.bits, self.ranks, out[start:stop])

        run_bands(work, len(flat), band=_VERTICES_PER_BAND, threads=threads)
        return numbers

    def touching(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """Return the faces with a marked corner, and the marks of their corners, -1 for none."""
        kept, marks = np.empty_like(faces), np.empty_like(faces)
        n = core.keep_marked_faces(faces, self.bits, self.ranks, kept, marks)
        return kept[:n], marks[:n]


def _no_bits(n_places: int) -> Words:
    return np.zeros(-(-n_places // _WORD), dtype=np.uint64)


@dataclass(frozen=True, eq=False)
class MeshSource:
    """A mesh in a file that can be read in chunks."""

    path: Path
    vertices: FileVertices
    n_rows: int  # polygons, at least
    # Yields all triangles in blocks of (n, 3) int32 vertices, checked; takes a number of threads.
    blocks: Callable[[int | None], Iterator[IntArray]]
    # Returns the normals and colors, (n, 3), of some vertices, by name; empty without any.
    attributes: Callable[[IntArray], dict[str, npt.NDArray[Any]]]
    has_uvs: bool = False  # which are not read


def open_source(path: PathLike) -> MeshSource | None:
    """Open a mesh file for reading in chunks; None for one that must be read as a whole."""
    opened = {".ply": _open_ply, ".stl": _open_stl}.get(Path(path).suffix.lower())
    return None if opened is None else opened(Path(path))


def _open_ply(path: Path) -> MeshSource | None:
    file = map_file(path)
    data = file.data
    header = read_header(path, data)
    if header.order == "":
        return None
    start = header.end
    for element in header.elements:
        if element.name == "vertex":
            break
        if element.name in ("face", "tristrips"):
            return None
        start = read_element(path, data, start, element, header.order)[1]
    else:
        return None
    offsets = _coordinate_offsets(element)
    faces = header.elements[header.elements.index(element) + 1 :][:1]
    has_copies = ply.COPY_OF in {prop.name for prop in element.properties}
    if offsets is None or has_copies or not faces or not _has_plain_faces(faces[0]):
        return None
    columns, end = read_element(path, data, start, element, header.order)
    layout = [start, element.least_row_size, 1, 0, *offsets, header.order == ">"]
    vertices = FileVertices(file, element.n_rows, np.array(layout, dtype=np.int64))
    require_rows(path, data, end, faces[0])
    return MeshSource(
        path,
        vertices,
        faces[0].n_rows,
        lambda threads: _ply_blocks(vertices, end, faces[0], header, threads),
        lambda chosen: _ply_attributes(path, columns, element, chosen),
        any(set(names) <= columns.keys() for names in ply.UV_NAMES),
    )


def _coordinate_offsets(vertex: Element) -> tuple[int, ...] | None:
    """Bytes of x, y and z in a row, and of each of them; None where they are not there alike."""
    offsets: dict[str, tuple[int, str]] = {}
    at = 0
    for prop in vertex.properties:
        if prop.count_type is not None:
            return None
        offsets[prop.name] = at, prop.type
        at += int(prop.type[1])
    places = [offsets.get(name, (0, "")) for name in "xyz"]
    types = {code for _, code in places}
    if len(types) != 1 or not types <= {"f4", "f8"}:
        return None
    return (*(place for place, _ in places), int(types.pop()[1]))


def _has_plain_faces(element: Element) -> bool:
    """Whether these are polygons whose corners are vertices and nothing else."""
    names = {prop.name for prop in element.properties}
    lists = {prop.name for prop in element.properties if prop.count_type is not None}
    return (
        element.name == "face"
        and len(lists & set(ply.POLYGON_NAMES)) == 1
        and not names & set(ply.CORNER_LISTS)
    )


def _ply_blocks(
    vertices: FileVertices, start: int, element: Element, header: Header, threads: int | None
) -> Iterator[IntArray]:
    path, n_before = vertices.file.path, 0
    name = next(prop.name for prop in element.properties if prop.name in ply.POLYGON_NAMES)
    layout = _triangle_layout(element)
    for first in range(0, element.n_rows, ROWS_PER_BLOCK):
        n_rows = min(ROWS_PER_BLOCK, element.n_rows - first)
        faces = None
        if layout is not None:
            faces = _read_triangles(vertices, start, n_rows, layout, header.order, threads)
        if layout is not None and faces is not None:
            start += n_rows * layout.row_size
        else:
            rows = Element("face", n_rows, element.properties)
            polygons, start = read_element(
                path, vertices.file.data, start, rows, header.order, first_row=first
            )
            sizes, corners = ply.read_polygons(path, polygons, name)
            known = np.clip(corners, 0, max(vertices.n - 1, 0))
            used, local = np.unique(known, return_inverse=True)
            positions = vertices.read(used, threads) if vertices.n else np.empty((0, 3))
            faces = corners[triangulated(path, positions, local, sizes)[0]]
            _check_indices(path, faces, n_before, vertices.n)
        n_before += len(faces)
        yield faces


class _TriangleLayout(NamedTuple):
    """Bytes of a row that is a triangle, those before its count, and those of its count."""

    row_size: int
    skipped: int
    count_size: int


def _triangle_layout(element: Element) -> _TriangleLayout | None:
    """Layout of rows with one list, of indices of four bytes; None for others."""
    lists = [prop for prop in element.properties if prop.count_type is not None]
    if len(lists) != 1 or lists[0].type not in ("i4", "u4"):
        return None
    at = element.properties.index(lists[0])
    skipped = sum(prop.least_size for prop in element.properties[:at])
    return _TriangleLayout(element.least_row_size + 12, skipped, lists[0].least_size)


def _read_triangles(
    vertices: FileVertices,
    start: int,
    n_rows: int,
    layout: _TriangleLayout,
    order: str,
    threads: int | None,
) -> IntArray | None:
    """(n_rows, 3) int32 vertices of rows that all are triangles; None where one is not."""
    data = vertices.file.data[start : start + n_rows * layout.row_size]
    if len(data) < n_rows * layout.row_size:
        return None
    faces = np.empty((n_rows, 3), dtype=np.int32)
    fits: list[bool] = []

    def read(first: int, stop: int) -> None:
        rows = data[first * layout.row_size : stop * layout.row_size]
        fits.append(
            core.read_triangle_rows(rows, *layout, order == ">", vertices.n, faces[first:stop])
        )

    run_bands(read, n_rows, band=1 << 16, threads=threads)
    return faces if all(fits) else None


def _check_indices(path: PathLike, faces: IntArray, first: int, n_vertices: int) -> None:
    if len(faces) and (faces.min() < 0 or faces.max() >= n_vertices):
        bad = ((faces < 0) | (faces >= n_vertices)).any(axis=1)
        raise MeshError(
            f"{path}: a position index is out of range "
            f"(face {first + int(bad.argmax())}; there are {n_vertices})"
        )


def _ply_attributes(
    path: Path, columns: Columns, element: Element, chosen: IntArray
) -> dict[str, npt.NDArray[Any]]:
    names = {*ply.NORMAL_NAMES, *ply.COLOR_NAMES} & columns.keys()
    rows: Columns = {
        name: column[chosen] for name in names if isinstance(column := columns[name], np.ndarray)
    }
    types = {prop.name: prop.type for prop in element.properties}
    found = {
        "normals": ply.stack_columns(rows, ply.NORMAL_NAMES),
        "colors": ply.read_colors(path, rows, types),
    }
    normals = found["normals"]
    if normals is not None and not np.isfinite(normals).all():  # one chunk, so no count
        warn_of(path, "some normals are not finite; computed ones replace them")
        normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return {name: values for name, values in found.items() if values is not None}


def _open_stl(path: Path) -> MeshSource | None:
    file = map_file(path)
    n_triangles = stl.binary_count(file.data)
    if n_triangles is None or n_triangles == 0:
        return None
    if len(file.data) != stl.HEADER_SIZE + 4 + n_triangles * stl.RECORD.itemsize:
        return None
    if 3 * n_triangles > np.iinfo(np.int32).max:
        raise FileFormatError(f"{path}: it has {n_triangles} triangles, more than can be numbered")
    fields = stl.RECORD.fields
    assert fields is not None
    first = stl.HEADER_SIZE + 4 + fields["corners"][1]
    layout = np.array([first, stl.RECORD.itemsize, 3, 12, 0, 4, 8, 4, 0], dtype=np.int64)

    def blocks(_: int | None) -> Iterator[IntArray]:
        for start in range(0, n_triangles, ROWS_PER_BLOCK):
            stop = min(start + ROWS_PER_BLOCK, n_triangles)
            yield np.arange(3 * start, 3 * stop, dtype=np.int32).reshape(-1, 3)

    vertices = FileVertices(file, 3 * n_triangles, layout)
    return MeshSource(path, vertices, n_triangles, blocks, lambda _: {})
