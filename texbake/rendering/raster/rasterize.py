"""Rasterizing triangles into a visibility buffer.

Two passes, each split into independent bands of work: the first sorts triangles into bands of rows,
the second draws each band on one thread, in the order of the triangles. Barycentric weights are
computed later, and only where they are needed (`texbake.rendering.raster.fragments`). With `behind`
and `before`, transparent surfaces are peeled layer by layer.

Kernel: `core/visibility_buffer.c`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.copies import later_copies
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.rendering.raster.clip import OFF_GRID, project
from texbake.rendering.raster.world import VisibilityBuffer, World

# Rows of samples per band, drawn by one thread: small enough to balance the load and to keep the
# band's part of the depth buffer in cache. As in `core/visibility_buffer.c`.
BAND_ROWS = 32
# Triangles per sorting task.
_CHUNK = 65536
# More than `_STACK` triangles that span more bands than this, in the mean, may be copies.
_MOST_BANDS_A_FACE, _STACK = 4, 256


@dataclass(frozen=True)
class Window:
    """Some rows and columns of a picture, in pixels or in samples.

    What is drawn in them is the same as in the whole picture.
    """

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


@dataclass(frozen=True, eq=False)
class _Bands:
    """Faces of each band of rows, ascending; band b has those at starts[b] to starts[b + 1]."""

    faces: IntArray
    starts: npt.NDArray[np.int64]


def _sorted_into_bands(
    world: World,
    modes: npt.NDArray[np.uint8],
    clip_from_world: FloatArray,
    grid: npt.NDArray[np.int32],
    size: tuple[int, int],
    window: Window,
    depths: npt.NDArray[np.float32] | None,
    threads: int | None,
) -> _Bands:
    """Sort the faces into bands of rows.

    With the depths of the vertices, copies of faces before them are left out where faces are large:
    at the same depth they never are in front.
    """
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
    if depths is not None and counts.sum() > _MOST_BANDS_A_FACE * max(n_survivors.sum(), _STACK):
        for chunk, copies in enumerate(
            _copies_on_grid(world, grid, depths, survivors, n_survivors)
        ):
            _drop(copies, survivors, spans, n_survivors, counts, chunk)
    # Band by band, and within each chunk by chunk.
    ends = np.cumsum(counts.T).reshape(n_bands, n_chunks)
    places = np.ascontiguousarray((ends - counts.T).T)
    sorted_faces = np.empty(ends[-1, -1], np.int32)

    def scatter(start: int, stop: int) -> None:
        chunk = start // _CHUNK
        kept = slice(start, start + n_survivors[chunk])
        core.scatter_triangles(survivors[kept], spans[kept], places[chunk], sorted_faces)

    run_bands(scatter, n_faces, band=_CHUNK, threads=threads)
    return _Bands(sorted_faces, np.append(0, ends[:, -1]))


def _copies_on_grid(
    world: World,
    grid: npt.NDArray[np.int32],
    depths: npt.NDArray[np.float32],
    survivors: IntArray,
    n_survivors: npt.NDArray[np.int64],
) -> list[npt.NDArray[np.bool_]]:
    """For each chunk, which survivors have the corners of one before them, on the grid."""
    starts = range(0, len(survivors), _CHUNK)
    kept = [survivors[i : i + n] for i, n in zip(starts, n_survivors.tolist(), strict=True)]
    corners = world.faces[np.concatenate(kept)]
    rows = np.concatenate([grid[corners], depths.view(np.int32)[corners][..., None]], axis=2)
    copies = later_copies(rows.reshape(-1, 9))
    copies[(rows[:, :, 0] == OFF_GRID).any(axis=1)] = False
    return np.split(copies, np.cumsum(n_survivors)[:-1])


def _drop(
    copies: npt.NDArray[np.bool_],
    survivors: IntArray,
    spans: npt.NDArray[np.int16],
    n_survivors: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    chunk: int,
) -> None:
    """Take copies out of what the first pass found in a chunk."""
    found = slice(chunk * _CHUNK, chunk * _CHUNK + len(copies))
    left = slice(found.start, found.start + int(np.count_nonzero(~copies)))
    survivors[left], spans[left] = survivors[found][~copies], spans[found][~copies]
    first, last = spans[left].T.astype(np.int64)
    n_bands = counts.shape[1]
    begins, ends = (np.bincount(at, minlength=n_bands + 1) for at in (first, last + 1))
    n_survivors[chunk], counts[chunk] = len(first), np.cumsum(begins - ends)[:n_bands]


def rasterize(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    modes: npt.NDArray[np.uint8],
    window: Window | None = None,
    behind: VisibilityBuffer | None = None,
    before: VisibilityBuffer | None = None,
    tries: npt.NDArray[np.uint32] | None = None,
    threads: int | None = None,
) -> VisibilityBuffer:
    """Rasterize triangles: find the nearest one at each sample.

    `clip_from_world` (4, 4) float64; `modes` (O,) uint8; `tries` (height, width) uint32.
    """
    grid, vertex_depths = project(world.positions, clip_from_world, width, height, threads=threads)
    size, window = (width, height), window or Window(0, height, 0, width)
    every_copy_counts = tries is not None or behind is not None
    bands = _sorted_into_bands(
        world, modes, clip_from_world, grid, size, window,
        None if every_copy_counts else vertex_depths, threads,
    )  # fmt: skip
    n_rows, n_columns = window.shape
    face_ids = np.full((n_rows, n_columns), -1, np.int32)
    depths = np.zeros((n_rows, n_columns), np.float32)
    peel: tuple[npt.NDArray[Any] | None, ...] = (None, None, None)
    if behind is not None and before is not None:
        peel = (behind.depths, behind.face_ids, before.depths)

    def draw(start: int, stop: int) -> None:
        for band in range(start, stop):
            first, last = bands.starts[band : band + 2]
            rows = band * BAND_ROWS, min((band + 1) * BAND_ROWS, n_rows)
            core.draw_triangles(
                world.positions, world.faces, world.starts, modes, clip_from_world, grid,
                vertex_depths, *size, window.left, window.top, bands.faces[first:last], *rows,
                *peel, tries, face_ids, depths,
            )  # fmt: skip

    run_bands(draw, -(-n_rows // BAND_ROWS), band=1, threads=threads)
    return VisibilityBuffer(face_ids, depths)
