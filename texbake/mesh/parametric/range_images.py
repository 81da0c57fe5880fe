"""Meshes from range images: a vertex for each pixel that has a distance, at that distance.

A scanner that turns about an object gives a cylindrical range image: the radius over angle and
height. A depth camera gives the distance along its axis for each pixel. Pixels that are 0, negative
or not finite have no distance, and leave holes.

Texture coordinates are the centers of the pixels, so that a photograph taken with the range fits.

Based on: Cyberware's cylindrical scans, as in Turk and Levoy, "Zippered polygon meshes from range
images", SIGGRAPH 1994, for leaving out triangles across steps in depth.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.parametric.options import check_triangles


def make_cylindrical_range(
    *,
    resolution: tuple[int, int] | None,
    image: npt.ArrayLike,
    radius: float,
    height: float,
    max_step: float | None,
) -> Mesh:
    """Surface around the y axis at radius · image.

    `image` (H, W) or (H, W, C): row 0 at the top.
    """
    ranges = radius * _distances(image, resolution)
    n_rows, n_columns = ranges.shape
    u, v = _centers(n_rows, n_columns)
    angles = 2.0 * math.pi * (u - 0.5)
    positions = np.stack(
        [
            ranges * pm.sin(angles),
            np.broadcast_to(height * (v - 0.5)[:, None], ranges.shape),
            ranges * pm.cos(angles),
        ],
        axis=-1,
    )
    return _joined(positions, ranges, max_step, closed=True, name="cylindrical range")


def make_depth_image(
    *,
    resolution: tuple[int, int] | None,
    image: npt.ArrayLike,
    distance: float,
    fov: float,
    max_step: float | None,
) -> Mesh:
    """Surface that a depth camera at the origin sees; it looks along -z.

    `image` (H, W) or (H, W, C): depths along the axis of the camera, row 0 at the top.
    """
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
    try:
        pixels = np.asarray(image, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("image: it is not an array of numbers; read a file first") from error
    if pixels.ndim == 3 and pixels.shape[2] > 0:
        pixels = pixels[..., 0]
    if pixels.ndim != 2 or min(pixels.shape) < 2:
        raise OptionError(
            f"image: an array of the shape {pixels.shape} is not an image of 2 x 2 pixels or more"
        )
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
    numbers = np.arange(ranges.size).reshape(ranges.shape)
    # One more column for the texture: the first one again, beyond the right border.
    places = np.column_stack([numbers, numbers[:, 0]]) if closed else numbers
    of_uvs = np.arange(places.size, dtype=np.int32).reshape(places.shape)
    corners, kept = _triangles(of_uvs, ranges.ravel()[places.ravel()], max_step)
    faces = places.ravel()[corners]
    if not kept.any():
        raise MeshError("image: no three neighboring pixels have a distance; nothing is to be made")
    u, v = _centers(n_rows, n_columns)
    if closed:
        u = np.append(u, u[0] + 1.0)
    uvs = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    used, vertex_faces = np.unique(faces[kept], return_inverse=True)
    used_uvs, uv_faces = np.unique(corners[kept], return_inverse=True)
    return Mesh(
        positions=positions.reshape(-1, 3)[used],
        faces=vertex_faces.reshape(-1, 3).astype(np.int32),
        uvs=uvs[used_uvs],
        uv_faces=uv_faces.reshape(-1, 3).astype(np.int32),
        name=name,
    )


def _triangles(
    numbers: IntArray, distances: FloatArray, max_step: float | None
) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """(2 S, 3) and (2 S,): two triangles for each square of neighbors, and which of them to keep.

    `numbers` (H, W) are the corners, and `distances` has one entry per number. Triangles are
    counter-clockwise. A square is divided from lower left to upper right, or along the other
    diagonal if that keeps more triangles, such as when one of those two corners has no distance.
    """
    upper_left, upper_right = numbers[:-1, :-1].ravel(), numbers[:-1, 1:].ravel()
    lower_left, lower_right = numbers[1:, :-1].ravel(), numbers[1:, 1:].ravel()

    def halves(
        *triangles: tuple[IntArray, IntArray, IntArray],
    ) -> tuple[IntArray, npt.NDArray[np.bool_]]:
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
