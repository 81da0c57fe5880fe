"""What pixels look at: rays of sight through any place in them."""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera


def sight_rays(
    camera: Camera, width: int, height: int, *, right: float = 0.0, down: float = 0.0
) -> FloatArray:
    """(H, W, 3) directions of sight in world space, one unit deep along the view.

    `right` and `down` are in pixels from the middle of each.
    """
    corner, to_right, to_below = camera.view_rays(width, height)
    columns = (np.arange(width) + 0.5 + right)[None, :, None]
    rows = (np.arange(height) + 0.5 + down)[:, None, None]
    return np.asarray(corner + columns * to_right + rows * to_below)


def ball_points(
    camera: Camera, rays: FloatArray, middle: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Where rays (..., 3) from the camera first meet a ball.

    Returns
    -------
    points : (..., 3) float64
        Of a ray that misses, where it comes nearest.
    cosines : (...) float64
        Of the angle of sight; 0 for a ray that misses.
    """
    units = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    to_middle = middle - camera.eye
    along = units @ to_middle
    inside = np.maximum(along**2 - to_middle @ to_middle + radius**2, 0.0)
    points = camera.eye + units * (along - np.sqrt(inside))[..., None]
    cosines = -np.einsum("...k,...k->...", points - middle, units) / radius
    return points, np.where(inside > 0.0, cosines, 0.0)
