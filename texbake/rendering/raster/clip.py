"""Clipping triangles, and snapping their corners to the fixed-point grid of the screen.

The screen has width x height samples, each at the center of its cell, with row 0 at the top.
Positions are integers in 1/256 of a sample, so coverage is decided exactly. Corners in front of the
near plane and within the guard band are snapped directly; a triangle with any other corner is first
clipped in homogeneous coordinates.

Based on: Sutherland and Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974; Blinn and Newell,
"Clipping using homogeneous coordinates", SIGGRAPH 1978. The guard band is so wide that few
triangles reach it. Intersections are always computed from the inner end of an edge, so two
triangles that share an edge are cut at the same point.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands

SUBPIXEL_BITS = 8
SUBPIXELS = 1 << SUBPIXEL_BITS
HALF = SUBPIXELS // 2
# Samples on either side of the screen's center. With the 2^18 samples of the largest screen, grid
# coordinates stay below 2^28 and edge functions below 2^60.
GUARD = 2.0**19
# Column that marks a vertex outside the grid.
OFF_GRID = np.iinfo(np.int32).min
# Corners of a triangle cut by five planes.
MAX_CORNERS = 8

# Vertices per band: about a millisecond of work.
_BAND = 65536


@kernel
def to_grid(x, y, w, width, height):  # type: ignore[no-untyped-def]
    """Snap a point of clip space (w > 0) to the grid: column and row in 1/256 of a sample."""
    column = (0.5 + 0.5 * x / w) * width
    row = (0.5 - 0.5 * y / w) * height
    return np.int64(np.floor(column * SUBPIXELS + 0.5)), np.int64(np.floor(row * SUBPIXELS + 0.5))


@kernel
def to_clip(matrix, position, out):  # type: ignore[no-untyped-def]
    """Write the homogeneous clip coordinates x, y, z, w of a position to `out`."""
    for i in range(4):
        out[i] = (
            matrix[i, 0] * position[0]
            + matrix[i, 1] * position[1]
            + matrix[i, 2] * position[2]
            + matrix[i, 3]
        )


@kernel
def _project_kernel(positions, matrix, width, height, grid, depths, start, stop):  # type: ignore[no-untyped-def]
    clip = np.empty(4)
    guard_x = 2.0 * GUARD / width
    guard_y = 2.0 * GUARD / height
    for v in range(start, stop):
        to_clip(matrix, positions[v], clip)
        x, y, z, w = clip[0], clip[1], clip[2], clip[3]
        if z <= w and abs(x) <= guard_x * w and abs(y) <= guard_y * w and 0.0 < w < np.inf:
            column, row = to_grid(x, y, w, width, height)
            grid[v, 0] = column
            grid[v, 1] = row
            depths[v] = z / w
        else:
            grid[v, 0] = OFF_GRID


def project(
    positions: FloatArray,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    threads: int | None = None,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Snap vertices to the grid of the screen.

    Parameters
    ----------
    positions : (V, 3) float64
        World space.
    clip_from_world : (4, 4) float64
        Camera matrix. In clip space z runs from 0 (infinity) to w (the near plane).
    width, height
        Size of the screen in samples.
    threads
        Number of threads; None uses every processor.

    Returns
    -------
    grid : (V, 2) int32
        Column and row in 1/256 of a sample; the column is `OFF_GRID` behind the near plane and
        outside the guard band.
    depths : (V,) float32
        z / w of the vertices that are on the grid.
    """
    grid = np.zeros((len(positions), 2), np.int32)
    depths = np.zeros(len(positions), np.float32)

    def work(start: int, stop: int) -> None:
        _project_kernel(positions, clip_from_world, width, height, grid, depths, start, stop)

    run_bands(work, len(positions), band=_BAND, threads=threads)
    return grid, depths


@kernel
def _inside(corner, plane, guard_x, guard_y):  # type: ignore[no-untyped-def]
    """Signed distance of a clip-space point to a plane (near, left, right, bottom, top)."""
    if plane == 0:
        return corner[3] - corner[2]
    if plane == 1:
        return guard_x * corner[3] + corner[0]
    if plane == 2:
        return guard_x * corner[3] - corner[0]
    if plane == 3:
        return guard_y * corner[3] + corner[1]
    return guard_y * corner[3] - corner[1]


@kernel
def _cut(inside, outside, distance_in, distance_out, out):  # type: ignore[no-untyped-def]
    """Intersect an edge with a plane, always starting from the inner end."""
    along = distance_in / (distance_in - distance_out)
    for k in range(4):
        out[k] = inside[k] + along * (outside[k] - inside[k])


@kernel
def clip_polygon(polygon, scratch, n_corners, width, height):  # type: ignore[no-untyped-def]
    """Clip a convex polygon in place against the near plane and the guard band.

    Parameters
    ----------
    polygon, scratch : (MAX_CORNERS, 4) float64
        Clip coordinates of the corners in order, and working memory.
    n_corners : int
        Number of corners before clipping.

    Returns
    -------
    int
        Number of corners after clipping; 0 if nothing is left.
    """
    guard_x = 2.0 * GUARD / width
    guard_y = 2.0 * GUARD / height
    for plane in range(5):
        n_kept = 0
        for i in range(n_corners):
            here = polygon[i]
            after = polygon[(i + 1) % n_corners]
            distance = _inside(here, plane, guard_x, guard_y)
            distance_after = _inside(after, plane, guard_x, guard_y)
            if distance >= 0.0:
                for k in range(4):
                    scratch[n_kept, k] = here[k]
                n_kept += 1
                if distance_after < 0.0:
                    _cut(here, after, distance, distance_after, scratch[n_kept])
                    n_kept += 1
            elif distance_after >= 0.0:
                _cut(after, here, distance_after, distance, scratch[n_kept])
                n_kept += 1
        n_corners = n_kept
        for i in range(n_corners):
            for k in range(4):
                polygon[i, k] = scratch[i, k]
    return n_corners


@kernel
def clip_triangle(  # type: ignore[no-untyped-def]
    positions, corners, matrix, width, height, polygon, scratch, points, depths
):
    """Clip a triangle against the near plane and the guard band, and snap the rest to the grid.

    Parameters
    ----------
    positions : (V, 3) float64
    corners : (3,) int32
        Indices into them.
    matrix : (4, 4) float64
        World space to clip space.
    polygon, scratch : (MAX_CORNERS, 4) float64
        Working memory; `polygon` receives the clip coordinates.
    points : (MAX_CORNERS, 2) int64
        Receives columns and rows in 1/256 of a sample.
    depths : (MAX_CORNERS,) float32
        Receives z / w.

    Returns
    -------
    int
        Number of corners left; 0 for none, or if a coordinate is not finite.
    """
    for i in range(3):
        to_clip(matrix, positions[corners[i]], polygon[i])
        for k in range(4):
            if not np.isfinite(polygon[i, k]):
                return 0
    n_corners = clip_polygon(polygon, scratch, 3, width, height)
    for i in range(n_corners):
        corner = polygon[i]
        column, row = to_grid(corner[0], corner[1], corner[3], width, height)
        points[i, 0] = column
        points[i, 1] = row
        depths[i] = corner[2] / corner[3]
    return n_corners
