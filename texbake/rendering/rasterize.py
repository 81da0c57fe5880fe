"""Rasterization: which triangle each sample of the picture sees, in a visibility buffer.

The screen has width x height samples, each at the center of its cell, with row 0 at the top.
Vertices are snapped to 1/256 of a sample, so coverage is decided exactly. Triangles with a corner
off this grid are clipped when they are drawn.

Triangles are sorted into bands of rows, each of which one thread draws in their order. Barycentric
weights are computed later, where they are needed (`texbake.rendering.fragments`). With `behind` and
`before`, transparent surfaces are peeled layer by layer.

The classical scanline rasterizer walks down the edges row by row, for teaching and as an
independent check: rounding errors accumulate along a span.

Based on: Burns and Hunt, "The visibility buffer: a cache-friendly approach to deferred shading",
JCGT 2(2), 2013.

Kernels: `core/clipping.c`, `core/visibility_buffer.c`, `core/scanline_rasterizer.c`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import AnyArray, ByteArray, Float32Array, FloatArray, Int64Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass

# Which faces of an object are drawn.
SKIP, CULL_BACK, SHOW_BACK = 0, 1, 2


@dataclass(frozen=True, eq=False)
class World:
    """Triangles in world space."""

    positions: FloatArray  # (V, 3)
    faces: IntArray  # (F, 3): front faces are counter-clockwise
    starts: Int64Array  # (O + 1,): faces of object k are at starts[k] to starts[k + 1]

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @property
    def n_objects(self) -> int:
        """Number of objects."""
        return len(self.starts) - 1


@dataclass(frozen=True, eq=False)
class VisibilityBuffer:
    """The nearest triangle at each sample of a screen; row 0 is at the top."""

    face_ids: IntArray  # (h, w): index of the nearest triangle in the world; -1 where there is none
    # (h, w): reversed depth z / w (greater is nearer); 0 where there is no triangle
    depths: Float32Array

    @property
    def n_bytes(self) -> int:
        """Memory of the buffer in bytes."""
        return self.face_ids.nbytes + self.depths.nbytes


def join_objects(parts: Sequence[tuple[FloatArray, IntArray]]) -> World:
    """Join the positions and faces of objects; a single object's arrays are shared, not copied."""
    starts = np.concatenate([[0], np.cumsum([len(faces) for _, faces in parts])]).astype(np.int64)
    if len(parts) == 1:
        positions, faces = parts[0]
    else:
        positions = np.concatenate([positions for positions, _ in parts])
        firsts = np.cumsum([0, *(len(positions) for positions, _ in parts[:-1])], dtype=np.int32)
        faces = np.concatenate(
            [faces + first for (_, faces), first in zip(parts, firsts, strict=True)]
        )
    return World(read_only(positions, np.float64), read_only(faces, np.int32), starts)


def read_only(array: AnyArray, dtype: type) -> AnyArray:
    """Return a contiguous, read-only array of a type, as the kernels expect their inputs."""
    view = np.require(array, dtype, "C").view()
    view.flags.writeable = False
    return view


# Units of the grid in a sample, and the column that marks a vertex outside the grid; as in
# `core/clipping.h`.
SUBPIXELS = 256
OFF_GRID = np.iinfo(np.int32).min
# Vertices per band: about a millisecond of work.
_BAND = 65536


def project(
    positions: FloatArray,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    threads: int | None = None,
) -> tuple[IntArray, Float32Array]:
    """Vertices (V, 2) on the grid, `OFF_GRID` behind the near plane or far off, and depths (V,)."""
    grid = np.zeros((len(positions), 2), np.int32)
    depths = np.zeros(len(positions), np.float32)
    kernel = partial(core.project_vertices, positions, clip_from_world, width, height, grid, depths)
    run_bands(kernel, len(positions), band=_BAND, threads=threads)
    return grid, depths


# Rows of samples per band, drawn by one thread: small enough to balance the load and to keep the
# band's part of the depth buffer in cache. As in `core/visibility_buffer.c`.
BAND_ROWS = 32
# Triangles per sorting task.
_CHUNK = 65536


@dataclass(frozen=True)
class Window:
    """Rows and columns of a picture, in pixels or in samples, drawn as in the whole picture."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return self.bottom - self.top, self.right - self.left

    def of_samples(self, side: int) -> Window:
        """Return the samples of these pixels, `side` x `side` in each."""
        return Window(self.top * side, self.bottom * side, self.left * side, self.right * side)


def _sorted_into_bands(
    world: World,
    modes: ByteArray,
    clip_from_world: FloatArray,
    grid: IntArray,
    size: tuple[int, int],
    window: Window,
    threads: int | None,
) -> tuple[IntArray, Int64Array]:
    """Faces of each band of rows, ascending; band b has those at starts[b] to starts[b + 1]."""
    n_rows, n_columns = window.shape
    n_faces, n_bands = world.n_faces, -(-n_rows // BAND_ROWS)
    n_chunks = -(-n_faces // _CHUNK)
    survivors = np.empty(n_faces, np.int32)
    spans = np.empty((n_faces, 2), np.int16)
    n_survivors = np.zeros(n_chunks, np.int64)
    counts = np.zeros((n_chunks, n_bands), np.int64)

    def sort(start: int, stop: int) -> None:
        chunk = start // _CHUNK
        n_survivors[chunk] = core.sort_triangles(
            world.positions, world.faces, world.starts, modes, clip_from_world, grid, *size,
            window.left, window.top, n_columns, n_rows, survivors, spans, counts[chunk],
            start, stop,
        )  # fmt: skip

    run_bands(sort, n_faces, band=_CHUNK, threads=threads)
    # Band by band, and within each chunk by chunk.
    ends = np.cumsum(counts.T).reshape(n_bands, n_chunks)
    places = np.ascontiguousarray((ends - counts.T).T)
    sorted_faces = np.empty(ends[-1, -1], np.int32)

    def scatter(start: int, stop: int) -> None:
        chunk = start // _CHUNK
        kept = slice(start, start + n_survivors[chunk])
        core.scatter_triangles(survivors[kept], spans[kept], places[chunk], sorted_faces)

    run_bands(scatter, n_faces, band=_CHUNK, threads=threads)
    return sorted_faces, np.append(0, ends[:, -1])


def rasterize(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    modes: ByteArray,
    window: Window | None = None,
    behind: VisibilityBuffer | None = None,
    before: VisibilityBuffer | None = None,
    tries: npt.NDArray[np.uint32] | None = None,
    threads: int | None = None,
) -> VisibilityBuffer:
    """Nearest triangle at each sample, beyond `behind`, nearer than `before`; adds to `tries`."""
    grid, vertex_depths = project(world.positions, clip_from_world, width, height, threads=threads)
    size, window = (width, height), window or Window(0, height, 0, width)
    faces, starts = _sorted_into_bands(world, modes, clip_from_world, grid, size, window, threads)
    n_rows, n_columns = window.shape
    face_ids = np.full((n_rows, n_columns), -1, np.int32)
    depths = np.zeros((n_rows, n_columns), np.float32)
    peel: tuple[AnyArray | None, ...] = (None, None, None)
    if behind is not None and before is not None:
        peel = (behind.depths, behind.face_ids, before.depths)

    def draw(start: int, stop: int) -> None:
        for band in range(start, stop):
            first, last = starts[band : band + 2]
            rows = band * BAND_ROWS, min((band + 1) * BAND_ROWS, n_rows)
            core.draw_triangles(
                world.positions, world.faces, world.starts, modes, clip_from_world, grid,
                vertex_depths, *size, window.left, window.top, faces[first:last], *rows,
                *peel, tries, face_ids, depths,
            )  # fmt: skip

    run_bands(draw, -(-n_rows // BAND_ROWS), band=1, threads=threads)
    return VisibilityBuffer(face_ids, depths)


def rasterize_scanlines(
    world: World, clip_from_world: FloatArray, width: int, height: int, *, modes: ByteArray
) -> tuple[VisibilityBuffer, FloatArray]:
    """Rasterize by scanlines, with the weights (height, width, 2) of second and third corner."""
    face_ids = np.full((height, width), -1, np.int32)
    depths = np.zeros((height, width), np.float32)
    weights = np.zeros((height, width, 2))
    core.draw_scanlines(
        world.positions, world.faces, world.starts, modes, clip_from_world,
        face_ids, depths, weights,
    )  # fmt: skip
    return VisibilityBuffer(face_ids, depths), weights
