"""Make meshes of parametric surfaces, with (u, v) as texture coordinates.

This module makes the plane, the height field, range images and the Möbius strip. Surfaces of
revolution and Bézier patches are in separate modules.

A plane and a height field face +z, with v along y. A height field has one vertex at the center of
each pixel, whose texture coordinates it has, so that an image of the same size fits it.

The center line of a Möbius strip is a circle about y through +z, where u is 1/2 and the strip is
upright; it rotates by pi per twist in a full turn. With an odd number of twists vertex (u = 1, v)
is (u = 0, 1 - v), and normals jump to the other side at that seam, whose edges `mesh_info` counts
as misoriented.

A cylindrical range image is the radius over angle and height; a depth image has distances along the
camera's axis. Pixels that are 0, negative or not finite leave holes. Texture coordinates are the
centers of the pixels, so that a photograph taken with the range fits.

Based on: do Carmo, "Differential Geometry of Curves and Surfaces", 1976, section 2-6, example 3
(the Möbius strip); Cyberware's cylindrical scans, as in Turk and Levoy, "Zippered polygon meshes
from range images", SIGGRAPH 1994, for leaving out triangles across steps in depth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.compose import used_rows
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.parametric.bezier import make_bezier, patches_of
from texbake.mesh.parametric.grid import (
    SurfaceGrid,
    circle_points,
    closed_lines,
    grid_mesh,
    half_steps,
    make_grid,
    open_lines,
)
from texbake.mesh.parametric.options import MakeOptions, check_triangles
from texbake.mesh.parametric.revolution import (
    make_cone,
    make_cylinder,
    make_revolution,
    make_sphere,
    make_torus,
    profile_of,
)


def make_cylindrical_range(
    *,
    resolution: tuple[int, int] | None,
    image: npt.ArrayLike,
    radius: float,
    height: float,
    max_step: float | None,
) -> Mesh:
    """Surface around the y axis at radius · image (H, W) or (H, W, C), row 0 at the top."""
    ranges = radius * _distances(image, resolution)
    u, v = _centers(*ranges.shape)
    angles = 2.0 * math.pi * (u - 0.5)
    heights = np.broadcast_to(height * (v - 0.5)[:, None], ranges.shape)
    positions = np.stack([ranges * pm.sin(angles), heights, ranges * pm.cos(angles)], axis=-1)
    return _joined(positions, ranges, max_step, closed=True, name="cylindrical range")


def make_depth_image(
    *,
    resolution: tuple[int, int] | None,
    image: npt.ArrayLike,
    distance: float,
    fov: float,
    max_step: float | None,
) -> Mesh:
    """Surface in front of a camera at the origin that looks along -z; `image` has depths."""
    depths = distance * _distances(image, resolution)
    n_rows, n_columns = depths.shape
    u, v = _centers(n_rows, n_columns)
    reach = pm.tan(math.radians(fov) / 2.0)
    across = (2.0 * u - 1.0) * reach * n_columns / n_rows
    up = (2.0 * v - 1.0) * reach
    positions = np.stack([depths * across, depths * up[:, None], -depths], axis=-1)
    return _joined(positions, depths, max_step, closed=False, name="depth image")


def _distances(image: npt.ArrayLike, resolution: tuple[int, int] | None) -> FloatArray:
    """(H, W) float64: distances, NaN where there is none."""
    if resolution is not None:
        raise OptionError("resolution: a range image has a vertex for each pixel; leave it out")
    pixels = _channels(image)[..., 0]
    check_triangles(2 * pixels.size)
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(pixels) & (pixels > 0.0), pixels, np.nan)


def _centers(n_rows: int, n_columns: int) -> tuple[FloatArray, FloatArray]:
    """U of the columns and v of the rows: the centers of pixels."""
    return (np.arange(n_columns) + 0.5) / n_columns, 1.0 - (np.arange(n_rows) + 0.5) / n_rows


def _joined(
    positions: FloatArray, ranges: FloatArray, max_step: float | None, *, closed: bool, name: str
) -> Mesh:
    """Join neighboring pixels by triangles where they have distances that differ little."""
    n_rows, n_columns = ranges.shape
    numbers = np.arange(ranges.size, dtype=np.int32).reshape(ranges.shape)
    # One more column for the texture: the first one again, beyond the right border.
    places: IntArray = np.column_stack([numbers, numbers[:, 0]]) if closed else numbers
    of_uvs = np.arange(places.size, dtype=np.int32).reshape(places.shape)
    corners, kept = _triangles(of_uvs, ranges.ravel()[places.ravel()], max_step)
    faces = places.ravel()[corners]
    if not kept.any():
        raise MeshError("image: no three neighboring pixels have a distance; nothing is to be made")
    u, v = _centers(n_rows, n_columns)
    if closed:
        u = np.append(u, u[0] + 1.0)
    uvs = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    used, vertex_faces = used_rows(faces[kept], ranges.size)
    used_uvs, uv_faces = used_rows(corners[kept], places.size)
    return Mesh(
        positions=positions.reshape(-1, 3)[used],
        faces=vertex_faces,
        uvs=uvs[used_uvs],
        uv_faces=uv_faces,
        name=name,
    )


def _triangles(
    numbers: IntArray, distances: FloatArray, max_step: float | None
) -> tuple[IntArray, BoolArray]:
    """(2 S, 3) triangles, two per square of `numbers` (H, W), and which of them to keep."""
    upper_left, upper_right = numbers[:-1, :-1].ravel(), numbers[:-1, 1:].ravel()
    lower_left, lower_right = numbers[1:, :-1].ravel(), numbers[1:, 1:].ravel()

    def halves(*triangles: tuple[IntArray, IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        corners = np.stack([np.stack(each, axis=1) for each in triangles], axis=1)
        known = distances[corners]
        with np.errstate(invalid="ignore"):
            steps = known.max(axis=2) - known.min(axis=2)
            return corners, np.isfinite(steps) & (steps <= (max_step or math.inf))

    corners, kept = halves(
        (lower_left, lower_right, upper_right), (lower_left, upper_right, upper_left)
    )
    others, others_kept = halves(
        (lower_left, lower_right, upper_left), (lower_right, upper_right, upper_left)
    )
    better = others_kept.sum(axis=1) > kept.sum(axis=1)
    corners[better], kept[better] = others[better], others_kept[better]
    return corners.reshape(-1, 3), kept.ravel()


def make(shape: str, options: MakeOptions | None = None, **changes: Any) -> Mesh:
    """Make a mesh of a parametric surface.

    Parameters
    ----------
    shape
        `plane` and `height-field` face +z. `cylinder`, `cone`, `sphere`, `torus`, `mobius` and
        `revolution` go around the y axis, with u = 1/2 at the front, +z, and the seam at the back;
        u grows counter-clockwise seen from above, and v upwards on the outside. `bezier` has the
        coordinates of its patches.
    options
        Choices that differ from the defaults; `MakeOptions` says which there are.
    **changes
        Fields of `MakeOptions` to change.

    Returns
    -------
    Mesh
        Texture coordinates are (u, v) in the unit square; each further surface (a cap, a patch) has
        a tile of its own. Faces are counter-clockwise seen from outside. Vertices are shared across
        seams and at poles, where each face takes the middle u of its own. All but height fields
        have the normals of the surface.

    Raises
    ------
    OptionError
        There is no such shape, or an option is out of range, missing, or not read by the shape.
    FileError, FileFormatError
        A profile or patch file cannot be read.
    MeshError
        The surface has no area.

    Examples
    --------
    >>> make("sphere", resolution=(8, 4)).n_faces
    48
    >>> make("cylinder", sides=6, caps=True).group_names
    ('side', 'bottom', 'top')
    """
    options = replace(options or MakeOptions(), **changes)
    settings = options.settings(shape)
    for name, read in ("profile", profile_of), ("patches", patches_of):
        if name in settings:
            settings[name] = read(settings[name])
    return _MAKERS[shape](**settings)


def make_plane(*, resolution: tuple[int, int], width: float, height: float) -> Mesh:
    """Rectangle about the origin in the plane z = 0, its normal +z."""
    grid, u, v = _laid_out(*resolution)
    # Of steps and not of u, so that opposite borders have opposite coordinates bit by bit.
    x, y = (
        (nodes - steps) * (length / (2 * steps))
        for nodes, steps, length in zip(grid.nodes.T, resolution, (width, height), strict=True)
    )
    return grid_mesh(
        grid,
        name="plane",
        positions=np.stack([x, y, np.zeros(len(x))], axis=-1),
        uvs=np.stack([u, v], axis=-1),
        normals=np.broadcast_to([0.0, 0.0, 1.0], (len(x), 3)),
    )


def make_height_field(
    *, resolution: tuple[int, int] | None, image: npt.ArrayLike, width: float, height: float
) -> Mesh:
    """Surface z = height · image (H, W) or (H, W, C) over a rectangle about the origin."""
    pixels = _gray(image)
    n_down, n_across = pixels.shape
    steps = (n_across - 1, n_down - 1) if resolution is None else resolution
    check_triangles(2 * steps[0] * steps[1])
    grid, along_u, along_v = _laid_out(*steps)
    # In pixels from the center of the lower left one.
    column, row = along_u * (n_across - 1), along_v * (n_down - 1)
    pixel = width / n_across
    x, y = (column - 0.5 * (n_across - 1)) * pixel, (row - 0.5 * (n_down - 1)) * pixel
    positions = np.stack([x, y, height * _bilinear(pixels[::-1], column, row)], axis=-1)
    uvs = np.stack([(column + 0.5) / n_across, (row + 0.5) / n_down], axis=-1)
    return grid_mesh(grid, name="height field", positions=positions, uvs=uvs)


def _laid_out(n_u: int, n_v: int) -> tuple[SurfaceGrid, FloatArray, FloatArray]:
    """Grid over the unit square, with u and v of its nodes."""
    grid = make_grid(open_lines(n_u), open_lines(n_v))
    u, v = (half_steps(np.arange(steps + 1) / steps) for steps in (n_u, n_v))
    return grid, u[grid.nodes[:, 0]], v[grid.nodes[:, 1]]


def _gray(image: npt.ArrayLike) -> FloatArray:
    """(H, W) float64: one or two channels are gray and alpha, three or four colors and alpha."""
    channels = _channels(image)
    pixels = channels[..., : 3 if channels.shape[2] > 2 else 1].mean(axis=2)
    if not np.isfinite(pixels).all():
        raise OptionError("image: some of its pixels are not finite")
    return np.asarray(pixels)


def _channels(image: npt.ArrayLike) -> FloatArray:
    """(H, W, C) float64 of an image."""
    try:
        pixels = np.asarray(image, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("image: it is not an array of numbers; read a file first") from error
    channels = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    if channels.ndim != 3 or min(channels.shape[:2]) < 2 or channels.shape[2] == 0:
        raise OptionError(
            f"image: an array of the shape {pixels.shape} is not an image of 2 x 2 pixels or more"
        )
    return channels


def _bilinear(pixels: FloatArray, column: FloatArray, row: FloatArray) -> FloatArray:
    """Values between pixels; at a whole column and row exactly the pixel's."""
    left = np.minimum(column.astype(np.int64), pixels.shape[1] - 2)
    below = np.minimum(row.astype(np.int64), pixels.shape[0] - 2)
    across, up = column - left, row - below
    low = (1.0 - across) * pixels[below, left] + across * pixels[below, left + 1]
    high = (1.0 - across) * pixels[below + 1, left] + across * pixels[below + 1, left + 1]
    return np.asarray((1.0 - up) * low + up * high)


def make_mobius(*, resolution: tuple[int, int], radius: float, width: float, twists: int) -> Mesh:
    """Closed strip whose cross section turns by half a turn for each of `twists`."""
    n_u, n_v = resolution
    grid = make_grid(closed_lines(n_u), open_lines(n_v), twisted=twists % 2 == 1)
    column, row = grid.nodes.astype(np.int64).T  # in half steps
    cos_a, sin_a = circle_points(2 * n_u)[(column + n_u) % (2 * n_u)].T
    # b is twists (column - n_u) of 4 n_u parts of a turn.
    cos_b, sin_b = circle_points(4 * n_u)[twists % (4 * n_u) * (column - n_u) % (4 * n_u)].T
    s = (row - n_v) * (width / (2 * n_v))
    r = radius + s * sin_b
    # Along u the point moves by 2 pi r around the axis and by pi twists s across the strip; the
    # normal, at a right angle to that and to the strip's direction, is a mix of two unit vectors.
    around, across = 2.0 * r, twists * s
    x, y = around * cos_b * sin_a - across * cos_a, -around * sin_b
    normals = np.stack([x, y, around * cos_b * cos_a + across * sin_a], axis=-1)
    return grid_mesh(
        grid,
        name="mobius",
        positions=np.stack([r * sin_a, s * cos_b, r * cos_a], axis=-1),
        uvs=np.stack([column / (2 * n_u), row / (2 * n_v)], axis=-1),
        normals=normals / pm.norm(normals, axis=1, keepdims=True),
    )


_MAKERS: dict[str, Callable[..., Mesh]] = {
    "plane": make_plane,
    "cylinder": make_cylinder,
    "cone": make_cone,
    "sphere": make_sphere,
    "torus": make_torus,
    "mobius": make_mobius,
    "revolution": make_revolution,
    "bezier": make_bezier,
    "height-field": make_height_field,
    "cylindrical-range": make_cylindrical_range,
    "depth-image": make_depth_image,
}
