"""The vertices of a mesh in a mapped file: positions are read where they are needed.

Kernel: `core/streamed_vertices.c`.
"""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import FileError, FileFormatError
from texbake.files import PathLike, require_file
from texbake.mesh.files.source import ByteArray
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

_VERTICES_PER_BAND = 1 << 18  # a multiple of 64: a word of bits is written by one band
_WORD = 64
# Vertices that are read between two releases: they may be spread over much of the file.
_AT_ONCE = 1 << 20
# Bits of the table of hashes for each position in it, of which three are set: about 1 vertex in 200
# is marked for nothing.
_BITS_PER_POSITION = 16

Words = npt.NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class FileVertices:
    """Positions of vertices in the bytes of a file."""

    file: MappedFile
    n: int  # number of vertices
    layout: npt.NDArray[np.int64]  # (9,) int64; where they are; see `core/streamed_vertices.c`

    @property
    def data(self) -> ByteArray:
        """(n_bytes,) uint8: the bytes of the file."""
        return self.file.data

    def read(self, vertices: IntArray, threads: int | None = None) -> FloatArray:
        """Positions of some vertices: (n, 3) float64."""
        positions = np.empty((len(vertices), 3))

        for first in range(0, len(vertices), _AT_ONCE):
            some, there = vertices[first : first + _AT_ONCE], positions[first : first + _AT_ONCE]

            def read(
                start: int, stop: int, some: IntArray = some, there: FloatArray = there
            ) -> None:
                core.read_vertices(self.data, self.layout, some[start:stop], 0, there[start:stop])

            run_bands(read, len(some), band=1 << 16, threads=threads)
            if len(some) == _AT_ONCE:
                self.file.release()
        return positions

    def of_faces(self, faces: IntArray, threads: int | None = None) -> tuple[FloatArray, IntArray]:
        """Return positions that have all corners of faces, and the faces as indices into them.

        Faces that stand together in a file mostly have vertices that do so too: then these are read
        one after another, else those of each corner.
        """
        if len(faces) == 0:
            return np.empty((0, 3)), faces
        first, last = int(faces.min()), int(faces.max())
        if last - first >= faces.size:
            corners = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
            return self.read(faces.reshape(-1), threads), corners
        positions = np.empty((last - first + 1, 3))

        def read(start: int, stop: int) -> None:
            core.read_vertices(self.data, self.layout, None, first + start, positions[start:stop])

        run_bands(read, len(positions), band=1 << 16, threads=threads)
        return positions, faces - np.int32(first)

    def not_finite(self, threads: int | None) -> VertexMarks | None:
        """Mark the vertices that are not finite; None if all are."""
        bad: list[int] = []

        def find(start: int, stop: int) -> None:
            while (found := core.find_not_finite(self.data, self.layout, start, stop)) >= 0:
                bad.append(found)
                start = found + 1

        run_bands(find, self.n, band=_VERTICES_PER_BAND, threads=threads)
        self.file.release()
        return VertexMarks.of_corners(np.array(bad, np.int32), self.n) if bad else None

    def at(self, positions: FloatArray, threads: int | None) -> VertexMarks:
        """Mark all vertices that lie at some positions, and a few others."""
        n_bits = _WORD
        while n_bits < _BITS_PER_POSITION * len(positions):
            n_bits *= 2
        table = np.zeros(n_bits // _WORD, dtype=np.uint64)
        core.set_hashes(positions, table)
        bits = _no_bits(self.n)

        def mark(start: int, stop: int) -> None:
            core.mark_by_hash(self.data, self.layout, table, start, stop, bits)

        run_bands(mark, self.n, band=_VERTICES_PER_BAND, threads=threads)
        self.file.release()
        return VertexMarks.of_bits(bits)


@dataclass(frozen=True, eq=False)
class VertexMarks:
    """Marks of some vertices, which number them in the order of the file."""

    bits: Words  # one bit for each vertex
    ranks: IntArray  # how many bits are set before each word of 64
    vertices: IntArray  # (n,) int32; the marked ones, in ascending order

    @classmethod
    def of_bits(cls, bits: Words) -> VertexMarks:
        """Number the marks."""
        ranks = np.empty(len(bits), dtype=np.int32)
        vertices = np.empty(core.rank_bits(bits, ranks), dtype=np.int32)
        core.list_bits(bits, vertices)
        return cls(bits, ranks, vertices)

    @classmethod
    def of_corners(cls, faces: IntArray, n_vertices: int) -> VertexMarks:
        """Mark the corners of faces."""
        bits = _no_bits(n_vertices)
        core.set_bits(faces.reshape(-1), bits)
        return cls.of_bits(bits)

    def touching(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """Return the faces with a marked corner, and the marks of their corners, -1 for none."""
        kept, marks = np.empty_like(faces), np.empty_like(faces)
        n = core.keep_marked_faces(faces, self.bits, self.ranks, kept, marks)
        return kept[:n], marks[:n]


def _no_bits(n_vertices: int) -> Words:
    return np.zeros(-(-n_vertices // _WORD), dtype=np.uint64)


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
        raise FileFormatError(f"{path}: the file is empty; write it again") from error
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    return MappedFile(path, np.frombuffer(pages, dtype=np.uint8), pages)
