"""The classical scanline rasterizer: walk down the edges row by row, then along each row.

All values are updated incrementally: the two edges from row to row, the values on a row from sample
to sample. Edge positions are integers over the edge's height, so coverage is exact and the same as
in `texbake.rendering.raster.rasterize`.

The values are depth and the three corner weights divided by w, which are linear on the screen up to
a common factor. Dividing by their sum at each sample makes the interpolation correct in
perspective. This rasterizer exists for teaching and as an independent check: it runs on one thread,
and rounding errors accumulate along a span.

Based on: Wylie, Romney, Evans and Erdahl, "Half-tone perspective drawings by computer", 1967;
Blinn, "Hyperbolic interpolation", IEEE Computer Graphics and Applications 12(4), 1992; Hecker,
"Perspective texture mapping", 1995.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.rendering.raster.clip import (
    HALF,
    MAX_CORNERS,
    SUBPIXELS,
    clip_triangle,
)
from texbake.rendering.raster.fragments import corner_edges
from texbake.rendering.raster.world import SHOW_BACK, SKIP, VisibilityBuffer, World

# Values that are updated incrementally: three corner weights before division, and depth.
_N_VALUES = 4


@kernel
def _corners_of(face, scene, polygon, scratch, edges, points, depths, values):  # type: ignore[no-untyped-def]
    """Write the grid positions of a clipped triangle's corners, and the values there."""
    positions, faces, matrix, width, height = scene
    n_corners = clip_triangle(
        positions, faces[face], matrix, width, height, polygon, scratch, points, depths
    )
    for i in range(n_corners):
        x, y = points[i, 0] / SUBPIXELS, points[i, 1] / SUBPIXELS
        for k in range(3):
            values[i, k] = edges[k, 0] * x + edges[k, 1] * y + edges[k, 2]
        values[i, 3] = depths[i]
    return n_corners


@kernel
def _edge_at(points, values, top, bottom, row, x, at):  # type: ignore[no-untyped-def]
    """Start an edge at a row of samples; writes its exact position to `x` and its values to `at`.

    `x` holds the column times the edge's height in grid units, its step, and that height.
    """
    tall = points[bottom, 1] - points[top, 1]
    down = row * SUBPIXELS + HALF - points[top, 1]
    across = points[bottom, 0] - points[top, 0]
    x[0] = points[top, 0] * tall + down * across
    x[1] = SUBPIXELS * across
    x[2] = tall
    for k in range(_N_VALUES):
        slope = (values[bottom, k] - values[top, k]) / tall
        at[0, k] = values[top, k] + down * slope
        at[1, k] = SUBPIXELS * slope


@kernel
def _step(x, at):  # type: ignore[no-untyped-def]
    """Step an edge down by one row."""
    x[0] += x[1]
    for k in range(_N_VALUES):
        at[0, k] += at[1, k]


@kernel
def _span(row, left_x, left, right_x, right, face, face_ids, depths, weights):  # type: ignore[no-untyped-def]
    """Draw the samples of a row from the left edge (included) to the right edge (excluded)."""
    width = face_ids.shape[1]
    first = -((HALF * left_x[2] - left_x[0]) // (SUBPIXELS * left_x[2]))
    stop = -((HALF * right_x[2] - right_x[0]) // (SUBPIXELS * right_x[2]))
    first, stop = max(first, 0), min(stop, width)
    if first >= stop:
        return
    start = left_x[0] / left_x[2]
    wide = right_x[0] / right_x[2] - start
    value, slope = np.empty(_N_VALUES), np.empty(_N_VALUES)
    for k in range(_N_VALUES):
        per_unit = (right[0, k] - left[0, k]) / wide
        value[k] = left[0, k] + (first * SUBPIXELS + HALF - start) * per_unit
        slope[k] = SUBPIXELS * per_unit
    for column in range(first, stop):
        depth = np.float32(value[3])
        if depth > depths[row, column]:
            total = value[0] + value[1] + value[2]
            depths[row, column] = depth
            face_ids[row, column] = face
            weights[row, column, 0] = min(max(value[1] / total, 0.0), 1.0)
            weights[row, column, 1] = min(max(value[2] / total, 0.0), 1.0)
        for k in range(_N_VALUES):
            value[k] += slope[k]


@kernel
def _triangle(points, values, i, face, shows_back, face_ids, depths, weights):  # type: ignore[no-untyped-def]
    """Draw triangle i of a fan (corners 0, i + 1 and i + 2), the upper part first."""
    top, middle, bottom = 0, i + 1, i + 2
    turn = (points[middle, 0] - points[top, 0]) * (points[bottom, 1] - points[top, 1]) - (
        points[middle, 1] - points[top, 1]
    ) * (points[bottom, 0] - points[top, 0])
    if turn == 0 or (turn > 0 and not shows_back):
        return
    if points[middle, 1] < points[top, 1]:
        top, middle, turn = middle, top, -turn
    if points[bottom, 1] < points[top, 1]:
        top, bottom, turn = bottom, top, -turn
    if points[bottom, 1] < points[middle, 1]:
        middle, bottom, turn = bottom, middle, -turn
    long_x, short_x = np.empty(3, np.int64), np.empty(3, np.int64)
    long_side, short_side = np.empty((2, _N_VALUES)), np.empty((2, _N_VALUES))
    for part in range(2):
        above, below = (top, middle) if part == 0 else (middle, bottom)
        first = max(-((HALF - points[above, 1]) // SUBPIXELS), 0)
        stop = min(-((HALF - points[below, 1]) // SUBPIXELS), face_ids.shape[0])
        if first >= stop:
            continue
        _edge_at(points, values, top, bottom, first, long_x, long_side)
        _edge_at(points, values, above, below, first, short_x, short_side)
        for row in range(first, stop):
            if turn > 0:  # the middle corner is right of the long edge
                _span(row, long_x, long_side, short_x, short_side, face, face_ids, depths, weights)
            else:
                _span(row, short_x, short_side, long_x, long_side, face, face_ids, depths, weights)
            _step(long_x, long_side)
            _step(short_x, short_side)


@kernel
def _scanline_kernel(scene, starts, modes, face_ids, depths, weights):  # type: ignore[no-untyped-def]
    positions, faces, matrix, width, height = scene
    polygon, scratch = np.empty((MAX_CORNERS, 4)), np.empty((MAX_CORNERS, 4))
    points = np.empty((MAX_CORNERS, 2), np.int64)
    values = np.empty((MAX_CORNERS, _N_VALUES))
    depth_values = np.empty(MAX_CORNERS, np.float32)
    clip, edges = np.empty((3, 4)), np.empty((3, 3))
    for owner in range(len(modes)):
        if modes[owner] == SKIP:
            continue
        for face in range(starts[owner], starts[owner + 1]):
            corner_edges(
                positions, faces[face], matrix, False, 2.0 / width, 2.0 / height, clip, edges
            )
            n_corners = _corners_of(
                face, scene, polygon, scratch, edges, points, depth_values, values
            )
            for i in range(n_corners - 2):
                _triangle(
                    points, values, i, face, modes[owner] == SHOW_BACK, face_ids, depths, weights
                )


def rasterize_scanlines(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    *,
    modes: npt.NDArray[np.uint8],
) -> tuple[VisibilityBuffer, FloatArray]:
    """Rasterize triangles by scanlines, with the barycentric weights at each sample.

    Parameters
    ----------
    world, clip_from_world, width, height, modes
        As for `texbake.rendering.raster.rasterize.rasterize`.

    Returns
    -------
    visibility : VisibilityBuffer
        The same as from `rasterize`, except where two surfaces are equally near up to rounding.
    weights : (height, width, 2) float64
        Weights of the second and third corner; 0 where there is no triangle.
    """
    face_ids = np.full((height, width), -1, np.int32)
    depths = np.zeros((height, width), np.float32)
    weights = np.zeros((height, width, 2))
    scene = world.positions, world.faces, clip_from_world, width, height
    _scanline_kernel(scene, world.starts, modes, face_ids, depths, weights)
    return VisibilityBuffer(face_ids, depths), weights
