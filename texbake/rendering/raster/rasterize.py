"""Rasterizing triangles into a visibility buffer.

Two passes, each split into independent bands of work. The first sorts triangles into bands of rows
and drops those that face away, are off the screen or fall between samples. The second draws each
band on one thread, in the order of the triangles. Barycentric weights are computed later, and only
where they are needed (`texbake.rendering.raster.fragments`).

Coverage is decided with integers: edge functions of grid positions in int64 and the top-left rule,
so each sample on a shared edge belongs to exactly one of the triangles. The nearest surface wins;
at equal depth, the triangle with the lower index wins.

With `behind` and `before`, only surfaces between two depth layers are drawn, so that transparent
surfaces can be peeled layer by layer.

Based on: Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988; Burns and Hunt,
"The visibility buffer", JCGT 2(2), 2013; Everitt, "Interactive order-independent
transparency", 2001, for peeling. Unlike Pineda, the first and last sample of a row of a wide
triangle are computed by division instead of a search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.rendering.raster.clip import (
    HALF,
    MAX_CORNERS,
    OFF_GRID,
    SUBPIXEL_BITS,
    SUBPIXELS,
    clip_triangle,
    project,
)
from texbake.rendering.raster.world import (
    SHOW_BACK,
    SKIP,
    VisibilityBuffer,
    World,
    object_of,
)

# Rows of samples per band, drawn by one thread: small enough to balance the load and to keep the
# band's part of the depth buffer in cache.
BAND_ROWS = 32
# Triangles per sorting task.
_CHUNK = 65536
# Up to this many samples in a row, testing each one is faster than dividing.
_NARROW = 12


@kernel
def _clipped(face, scene, polygon, scratch, points, depths):  # type: ignore[no-untyped-def]
    """Write the grid positions and depths of a clipped triangle's corners.

    `scene` is (positions, faces, object starts, object modes, matrix, grid, vertex depths, width,
    height). Returns the number of corners; 0 if nothing is left.
    """
    corners = scene[1][face]
    return clip_triangle(
        scene[0], corners, scene[4], scene[7], scene[8], polygon, scratch, points, depths
    )


@kernel
def _doubled_area(points, i):  # type: ignore[no-untyped-def]
    """Twice the area of triangle i of a fan, in grid units squared; negative if front-facing."""
    along_x = points[i + 1, 0] - points[0, 0]
    along_y = points[i + 1, 1] - points[0, 1]
    return along_x * (points[i + 2, 1] - points[0, 1]) - along_y * (points[i + 2, 0] - points[0, 0])


@kernel
def _sort_kernel(scene, survivors, spans, counts, start, stop):  # type: ignore[no-untyped-def]
    faces, starts, modes, grid = scene[1], scene[2], scene[3], scene[5]
    width, height = scene[7], scene[8]
    polygon = np.empty((MAX_CORNERS, 4))
    scratch = np.empty((MAX_CORNERS, 4))
    points = np.empty((MAX_CORNERS, 2), np.int64)
    depths = np.empty(MAX_CORNERS, np.float32)
    n_survivors = 0
    owner = object_of(start, starts)
    for face in range(start, stop):
        while face >= starts[owner + 1]:
            owner += 1
        if modes[owner] == SKIP:
            continue
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, bx, cx = grid[a, 0], grid[b, 0], grid[c, 0]
        if ax != OFF_GRID and bx != OFF_GRID and cx != OFF_GRID:
            ay, by, cy = grid[a, 1], grid[b, 1], grid[c, 1]
            # numba widens each operation on int32 to int64.
            area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            if area == 0 or (area > 0 and modes[owner] != SHOW_BACK):
                continue
            left, right = min(ax, bx, cx), max(ax, bx, cx)
            top, bottom = min(ay, by, cy), max(ay, by, cy)
        else:
            n_corners = _clipped(face, scene, polygon, scratch, points, depths)
            if n_corners < 3:
                continue
            left, right, top, bottom = points[0, 0], points[0, 0], points[0, 1], points[0, 1]
            for i in range(1, n_corners):
                left, right = min(left, points[i, 0]), max(right, points[i, 0])
                top, bottom = min(top, points[i, 1]), max(bottom, points[i, 1])
        # Samples within the bounding box; most tiny triangles contain none.
        first = (max(left, 0) + HALF - 1) >> SUBPIXEL_BITS
        last = (min(right, width * SUBPIXELS) - HALF) >> SUBPIXEL_BITS
        first_row = (max(top, 0) + HALF - 1) >> SUBPIXEL_BITS
        last_row = (min(bottom, height * SUBPIXELS) - HALF) >> SUBPIXEL_BITS
        if first > last or first_row > last_row:
            continue
        survivors[start + n_survivors] = face
        spans[start + n_survivors, 0] = first_row // BAND_ROWS
        spans[start + n_survivors, 1] = last_row // BAND_ROWS
        n_survivors += 1
        for band in range(first_row // BAND_ROWS, last_row // BAND_ROWS + 1):
            counts[band] += 1
    return n_survivors


@kernel
def _scatter_kernel(survivors, spans, next_places, sorted_faces):  # type: ignore[no-untyped-def]
    for i in range(len(survivors)):
        for band in range(spans[i, 0], spans[i, 1] + 1):
            sorted_faces[next_places[band]] = survivors[i]
            next_places[band] += 1


@kernel
def _row_range(value, step, threshold, first, last):  # type: ignore[no-untyped-def]
    """Narrow first..last to the k for which value + k * step is at least the threshold."""
    if step > 0:
        first = max(first, -((value - threshold) // step))
    elif step < 0:
        last = min(last, (value - threshold) // -step)
    elif value < threshold:
        last = first - 1
    return first, last


@kernel
def _is_peeled(depth, face, row, column, peel):  # type: ignore[no-untyped-def]
    """Whether a point lies on or before the layer already peeled, or behind the last surface.

    `peel` is (depths and faces of the layer, depths of the last surface).
    """
    layer = peel[0][row, column]
    if depth > layer or (depth == layer and face <= peel[1][row, column]):
        return True
    return depth <= peel[2][row, column]


@kernel
def _draw(points, depths, i, face, show_back, rows, peels, peel, tries, face_ids, depth_buffer):  # type: ignore[no-untyped-def]
    """Draw triangle i of a fan (corners 0, i + 1 and i + 2) into some rows."""
    area = _doubled_area(points, i)
    if area == 0 or (area > 0 and not show_back):
        return
    # Order the corners so that the area is positive: clockwise on the screen, as rows go down.
    b, c = (i + 1, i + 2) if area > 0 else (i + 2, i + 1)
    x0, y0, x1, y1, x2, y2 = (
        points[0, 0], points[0, 1], points[b, 0], points[b, 1], points[c, 0], points[c, 1],
    )  # fmt: skip
    z0, z1, z2 = np.float64(depths[0]), np.float64(depths[b]), np.float64(depths[c])
    left = max((min(x0, x1, x2) + HALF - 1) >> SUBPIXEL_BITS, 0)
    right = min((max(x0, x1, x2) - HALF) >> SUBPIXEL_BITS, face_ids.shape[1] - 1)
    top = max((min(y0, y1, y2) + HALF - 1) >> SUBPIXEL_BITS, rows[0])
    bottom = min((max(y0, y1, y2) - HALF) >> SUBPIXEL_BITS, rows[1] - 1)
    # Edge functions, each 0 on the edge opposite its corner. By the top-left rule a sample on a
    # left edge (going up) or a top edge (going right) is inside: least value 0 there, 1 elsewhere.
    least0 = 0 if y2 < y1 or (y2 == y1 and x2 > x1) else 1
    least1 = 0 if y0 < y2 or (y0 == y2 and x0 > x2) else 1
    least2 = 0 if y1 < y0 or (y1 == y0 and x1 > x0) else 1
    step0, step1, step2 = (y1 - y2) * SUBPIXELS, (y2 - y0) * SUBPIXELS, (y0 - y1) * SUBPIXELS
    x = left * SUBPIXELS + HALF
    scale = 1.0 / abs(area)
    for row in range(top, bottom + 1):
        y = row * SUBPIXELS + HALF
        edge0 = (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)
        edge1 = (x0 - x2) * (y - y2) - (y0 - y2) * (x - x2)
        edge2 = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
        first, last = 0, right - left
        if last >= _NARROW:
            first, last = _row_range(edge0, step0, least0, first, last)
            first, last = _row_range(edge1, step1, least1, first, last)
            first, last = _row_range(edge2, step2, least2, first, last)
        for k in range(first, last + 1):
            e0, e1, e2 = edge0 + k * step0, edge1 + k * step1, edge2 + k * step2
            if e0 >= least0 and e1 >= least1 and e2 >= least2:
                # z / w is linear on the screen; a weighted mean stays within the corners' range.
                depth = np.float32((e0 * z0 + e1 * z1 + e2 * z2) * scale)
                if len(tries) > 0:
                    tries[row, left + k] += 1
                if depth > depth_buffer[row, left + k]:
                    if peels and _is_peeled(depth, face, row, left + k, peel):
                        continue
                    depth_buffer[row, left + k] = depth
                    face_ids[row, left + k] = face


@kernel
def _draw_kernel(scene, band_faces, rows, peels, peel, tries, face_ids, depth_buffer):  # type: ignore[no-untyped-def]
    faces, starts, modes, grid, vertex_depths = scene[1], scene[2], scene[3], scene[5], scene[6]
    polygon = np.empty((MAX_CORNERS, 4))
    scratch = np.empty((MAX_CORNERS, 4))
    points = np.empty((MAX_CORNERS, 2), np.int64)
    depths = np.empty(MAX_CORNERS, np.float32)
    for k in range(len(band_faces)):
        face = np.int64(band_faces[k])
        n_corners = 3
        show_back = True  # culled faces were dropped when sorting
        for i in range(3):
            v = faces[face, i]
            points[i, 0] = grid[v, 0]
            points[i, 1] = grid[v, 1]
            depths[i] = vertex_depths[v]
            if grid[v, 0] == OFF_GRID:
                n_corners = 0
        if n_corners == 0:
            show_back = modes[object_of(face, starts)] == SHOW_BACK
            n_corners = _clipped(face, scene, polygon, scratch, points, depths)
        for i in range(n_corners - 2):
            _draw(
                points, depths, i, face, show_back, rows, peels, peel, tries, face_ids, depth_buffer
            )


@dataclass(frozen=True, eq=False)
class _Bands:
    """Faces of each band of rows, ascending; band b has those at starts[b] to starts[b + 1]."""

    faces: IntArray
    starts: npt.NDArray[np.int64]


def _sorted_into_bands(
    scene: tuple[object, ...], n_faces: int, n_bands: int, threads: int | None
) -> _Bands:
    n_chunks = -(-n_faces // _CHUNK)
    survivors = np.empty(n_faces, np.int32)
    spans = np.empty((n_faces, 2), np.int16)
    n_survivors = np.zeros(n_chunks, np.int64)
    counts = np.zeros((n_chunks, n_bands), np.int64)

    def sort(start: int, stop: int) -> None:
        chunk = start // _CHUNK
        n_survivors[chunk] = _sort_kernel(scene, survivors, spans, counts[chunk], start, stop)

    run_bands(sort, n_faces, band=_CHUNK, threads=threads)
    # Band by band, and within each chunk by chunk.
    ends = np.cumsum(counts.T).reshape(n_bands, n_chunks)
    places = np.ascontiguousarray((ends - counts.T).T)
    sorted_faces = np.empty(ends[-1, -1], np.int32)

    def scatter(start: int, stop: int) -> None:
        chunk = start // _CHUNK
        kept = slice(start, start + n_survivors[chunk])
        _scatter_kernel(survivors[kept], spans[kept], places[chunk], sorted_faces)

    run_bands(scatter, n_faces, band=_CHUNK, threads=threads)
    return _Bands(sorted_faces, np.append(0, ends[:, -1]))


def rasterize(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    modes: npt.NDArray[np.uint8],
    behind: VisibilityBuffer | None = None,
    before: VisibilityBuffer | None = None,
    tries: npt.NDArray[np.uint32] | None = None,
    threads: int | None = None,
) -> VisibilityBuffer:
    """Rasterize triangles: find the nearest one at each sample.

    Parameters
    ----------
    world
        All triangles; front faces are counter-clockwise.
    clip_from_world : (4, 4) float64
        Camera matrix. In clip space z runs from 0 (infinity) to w (the near plane).
    width, height
        Size of the screen in samples.
    modes : (O,) uint8
        `SKIP`, `CULL_BACK` or `SHOW_BACK` for each object.
    behind, before
        Give both or neither. Only surfaces that lie behind `behind` (or at the same depth with a
        higher index) and in front of `before` are drawn.
    tries : (height, width) uint32, optional
        Counts the triangles that cover each sample, visible or hidden; added to in place.
    threads
        Number of threads; None uses every processor.

    Returns
    -------
    VisibilityBuffer
        A triangle without area on the grid is not visible.
    """
    grid, vertex_depths = project(world.positions, clip_from_world, width, height, threads=threads)
    scene = (
        world.positions, world.faces, world.starts, modes, clip_from_world,
        grid, vertex_depths, width, height,
    )  # fmt: skip
    n_bands = -(-height // BAND_ROWS)
    bands = _sorted_into_bands(scene, world.n_faces, n_bands, threads)
    face_ids = np.full((height, width), -1, np.int32)
    depths = np.zeros((height, width), np.float32)
    peel = (depths, face_ids, depths)  # not read
    counted = np.empty((0, width), np.uint32) if tries is None else tries
    if behind is not None and before is not None:
        peel = (behind.depths, behind.face_ids, before.depths)

    def draw(start: int, stop: int) -> None:
        for band in range(start, stop):
            first, last = bands.starts[band : band + 2]
            rows = band * BAND_ROWS, min((band + 1) * BAND_ROWS, height)
            _draw_kernel(
                scene, bands.faces[first:last], rows, behind is not None, peel, counted,
                face_ids, depths,
            )  # fmt: skip

    run_bands(draw, n_bands, band=1, threads=threads)
    return VisibilityBuffer(face_ids, depths)
