"""A mesh in a file that is read in chunks: its triangles in their order, and parts of it.

The memory that it takes depends on the size of a chunk or of a part, not on the number of its
triangles, but for one bit for each vertex.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from texbake.core import core
from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.files.conversion import warn_unused
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import add_angle_weighted, fill_canceled, normalize_sums
from texbake.mesh.streamed.source import Marks, MeshSource, open_source
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass

_FACES_PER_BAND = 1 << 15


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some triangles of a mesh, one after another."""

    first: int  # number of the first triangle in the mesh
    positions: FloatArray  # (V, 3) float64
    faces: IntArray  # (F, 3) int32; indices into `positions`
    bounds: FloatArray  # (2, 3) float64; least and greatest coordinates of the triangles


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Some triangles of a mesh by themselves."""

    mesh: Mesh  # with normals and colors, where the file has them
    # (V,) int32; which vertices of the file its positions are, in ascending order.
    vertices: IntArray


@dataclass(frozen=True, eq=False)
class StreamedMesh:
    """A mesh that stays in its file. Made by `StreamedMesh.open`."""

    name: str  # the file's, without the folder
    n_faces: int  # number of triangles
    bounds: FloatArray  # (2, 3) float64; least and greatest coordinates of the triangles
    _source: MeshSource
    _threads: int | None

    @classmethod
    def open(cls, source: MeshSource, *, threads: int | None = None) -> StreamedMesh:
        """Check all of a mesh, and measure it."""
        not_finite = source.vertices.not_finite(threads)
        n_faces, boxes = 0, []
        for faces in source.blocks(threads):
            if not_finite is not None and len(not_finite.touching(faces)[0]):
                raise MeshError(f"{source.path}: a position is not finite")
            n_faces += len(faces)
            boxes.append(_bounds(*source.vertices.of_faces(faces, threads), threads))
            source.vertices.file.release()
        if n_faces == 0:
            raise MeshError(f"{source.path}: it has no faces; a mesh needs at least one triangle")
        if not_finite is not None:
            warn_unused(source.path, f"{len(not_finite.places):,} of {source.vertices.n:,}")
        if n_faces > np.iinfo(np.int32).max:
            raise MeshError(f"{source.path}: it has {n_faces} triangles, more than can be numbered")
        low, high = np.stack(boxes).transpose(1, 0, 2)
        bounds = frozen(np.stack([low.min(axis=0), high.max(axis=0)]))
        return cls(source.path.name, n_faces, bounds, source, threads)

    def chunks(self, n_faces: int) -> Iterator[Chunk]:
        """Yield all triangles, in chunks of `n_faces`."""
        vertices, first = self._source.vertices, 0
        threads = self._threads
        for faces in _regrouped(self._source.blocks(threads), n_faces):
            positions, faces = vertices.of_faces(faces, threads)
            vertices.file.release()
            yield Chunk(first, positions, faces, _bounds(positions, faces, threads))
            first += len(faces)

    def pieces(self, n_faces: int) -> Iterator[Mesh]:
        """Yield all triangles, in meshes of `n_faces` with the normals and colors of the file."""
        for faces in _regrouped(self._source.blocks(self._threads), n_faces):
            yield self._piece(faces)[0]

    def _piece(self, faces: IntArray) -> tuple[Mesh, IntArray]:
        """Return some triangles, and (V,) int32: which vertices of the file their positions are."""
        vertices = self._source.vertices
        marks = Marks.of(faces, vertices.n)
        fields: dict[str, Any] = self._source.attributes(marks.places)
        faces = marks.numbers_of(faces, self._threads)
        if "normals" in fields:
            fields["normal_faces"] = faces
        positions = vertices.read(marks.places, self._threads)
        vertices.file.release()
        return Mesh(positions=positions, faces=faces, name=self.name, **fields), marks.places

    def spread_corners(self, step: int) -> FloatArray:
        """(3 n, 3) float64: the corners of every `step`-th triangle, one triangle after another."""
        points, first = [], 0
        for faces in self._source.blocks(self._threads):
            chosen = faces[-first % step :: step].reshape(-1)
            points.append(self._source.vertices.read(chosen))
            first += len(faces)
            self._source.vertices.file.release()
        return np.concatenate(points)

    def part(self, face_ids: IntArray) -> MeshPart:
        """Return some triangles, (n,) ids in ascending order, by themselves."""
        mesh, vertices = self._piece(self._chosen(face_ids))
        if mesh.normals is not None and (missing := (mesh.normals == 0.0).all(axis=1)).any():
            normals = mesh.normals.copy()
            normals[missing] = self.smooth_normals(vertices[missing])
            mesh = mesh.replace(normals=normals)
        return MeshPart(mesh, vertices)

    def _chosen(self, face_ids: IntArray) -> IntArray:
        """(n, 3) int32 vertices of some triangles."""
        pieces, first = [np.empty((0, 3), dtype=np.int32)], 0
        for faces in self._source.blocks(self._threads):
            start, stop = np.searchsorted(face_ids, (first, first + len(faces)))
            pieces.append(faces[face_ids[start:stop] - first])
            first += len(faces)
            self._source.vertices.file.release()
            if len(face_ids) == 0 or first > face_ids[-1]:
                break
        return np.concatenate(pieces)

    def smooth_normals(self, vertices: IntArray) -> FloatArray:
        """(n, 3) float64 normals as `smooth_normals`, at (n,) vertices in ascending order."""
        source, threads = self._source, self._threads
        marks = source.vertices.at(source.vertices.read(vertices, threads), threads)
        positions = source.vertices.read(marks.places, threads)
        source.vertices.file.release()
        firsts = weld_rows(positions, threads=threads)
        del positions
        normals = np.zeros((len(firsts), 3))
        scale = unit_scale(float(np.abs(self.bounds).max()))
        for around in self._around(marks, firsts):
            add_angle_weighted(normals, *around, scale, threads)
        normalize_sums(normals, threads)
        wanted = firsts[marks.numbers_of(vertices, threads)]
        if (normals[wanted] == 0.0).all(axis=1).any():
            for around in self._around(marks, firsts):
                fill_canceled(normals, *around)
        return np.asarray(normals[wanted])

    def _around(
        self, marks: Marks, firsts: IntArray
    ) -> Iterator[tuple[FloatArray, IntArray, IntArray]]:
        """Yield triangles with marked corners: positions, faces, and the mark of each corner."""
        vertices = self._source.vertices
        marks_of = np.append(firsts, np.int32(-1))  # -1 is the last
        for faces in self._source.blocks(self._threads):
            some, rows = _touching(marks, faces, self._threads)
            if len(some):
                yield *vertices.of_faces(some, self._threads), marks_of[rows]
            vertices.file.release()


def _touching(marks: Marks, faces: IntArray, threads: int | None) -> tuple[IntArray, IntArray]:
    """Return the result of `Marks.touching`, computed in bands."""
    if len(faces) == 0:
        return faces, faces
    bands: dict[int, tuple[IntArray, IntArray]] = {}

    def keep(start: int, stop: int) -> None:
        bands[start] = marks.touching(faces[start:stop])

    run_bands(keep, len(faces), band=_FACES_PER_BAND, threads=threads)
    kept, rows = zip(*(bands[start] for start in sorted(bands)), strict=True)
    return np.concatenate(kept), np.concatenate(rows)


def open_streamed(path: PathLike, *, threads: int | None = None) -> StreamedMesh | None:
    """Open a mesh file to be read in chunks; None for one that must be read as a whole."""
    source = open_source(path)
    return None if source is None else StreamedMesh.open(source, threads=threads)


def _regrouped(blocks: Iterator[IntArray], n_faces: int) -> Iterator[IntArray]:
    """Yield the rows of blocks in groups of `n_faces`, of which the last may have fewer."""
    waiting: list[IntArray] = []
    n_waiting = 0
    for block in blocks:
        while n_waiting + len(block) >= n_faces:
            n_taken = n_faces - n_waiting
            yield np.concatenate([*waiting, block[:n_taken]])
            block, waiting, n_waiting = block[n_taken:], [], 0
        waiting.append(block)
        n_waiting += len(block)
    if n_waiting:
        yield np.concatenate(waiting)


def _bounds(positions: FloatArray, faces: IntArray, threads: int | None) -> FloatArray:
    """(2, 3) float64: least and greatest coordinates of the corners of faces."""
    boxes = np.empty((-(-len(faces) // _FACES_PER_BAND), 6))

    def bound(start: int, stop: int) -> None:
        core.bound_corners(positions, faces[start:stop], boxes[start // _FACES_PER_BAND])

    run_bands(bound, len(faces), band=_FACES_PER_BAND, threads=threads)
    low, high = boxes[:, :3].min(axis=0, initial=np.inf), boxes[:, 3:].max(axis=0, initial=-np.inf)
    return np.stack([low, high])
