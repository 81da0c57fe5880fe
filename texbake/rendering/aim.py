"""Whether spots and projected pictures may meet objects, by bounding boxes. May say yes wrongly."""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import TexbakeError
from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.material import ProjectedTexture
from texbake.rendering.scene.scene import SceneObject

# Radians by which a cone counts as wider.
_ROUNDING = 1e-6


def lights_object(light: Light, item: SceneObject, camera: Camera | None = None) -> bool:
    """Whether the cone of a spot may meet the bounding sphere of an object.

    `camera` is needed for a light that follows the camera.
    """
    corners = _corners(item)
    if corners is None:
        return True
    center = corners.mean(axis=0)
    radius = float(pm.norm(corners - center, axis=1).max())
    position, direction = (
        np.asarray(vector, np.float64) for vector in (light.position, light.direction)
    )
    if light.follows_camera and camera is not None:
        position = camera.eye + pm.matmul(position, camera.axes)
        direction = pm.matmul(direction, camera.axes)
    way = center - position
    distance = float(pm.norm(way))
    if not radius < distance < math.inf:
        return True
    reach = pm.tan(math.radians(light.angle) / 2.0)
    if light.profile is not None and light.gate == "rectangle":
        reach *= math.sqrt(2.0)  # the corner of a square slide, the farthest of any
    cosine = float(pm.matmul(way, direction)) / (distance * float(pm.norm(direction)))
    angle = pm.arccos(min(max(cosine, -1.0), 1.0))
    return angle - pm.arcsin(radius / distance) <= pm.arctan(reach) + _ROUNDING


def hits_object(picture: ProjectedTexture, item: SceneObject) -> bool:
    """Whether a projected picture, with a margin, may meet an object's bounding box.

    The margin is the width and height of the picture on each side. If the result depends on the
    aspect of a file, the file is opened only for objects in front of the projector and between the
    upper and lower bounds; a file that cannot be read counts as square.
    """
    corners = _corners(item)
    if corners is None:
        return True
    points = np.concatenate([corners, np.ones((8, 1))], 1).T
    matrix = picture.matrix
    if callable(matrix):
        square = matrix(aspect=1.0)
        if _passes(square, points, across=False):
            return False
        try:
            matrix = picture.world_matrix
        except TexbakeError:
            matrix = square
    return not _passes(matrix, points, across=True)


def _passes(matrix: FloatArray, points: FloatArray, *, across: bool) -> bool:
    """Whether all points (4, n) are behind a projector or beyond one side of its picture."""
    with np.errstate(over="ignore", invalid="ignore"):
        s, t, _, q = pm.matmul(matrix, points)
        beyond = [q <= 0.0, t < -q, t > 2.0 * q]
        beyond += [s < -q, s > 2.0 * q] if across else []
    return any(side.all() for side in beyond)


def _corners(item: SceneObject) -> FloatArray | None:
    """(8, 3): corners of the bounding box in the world; None for a surface that leaves its box."""
    if item.material.displacement is not None:
        return None
    corners = item.box_corners()
    if item.transform is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            corners = pm.matmul(corners, item.transform[:3, :3].T) + item.transform[:3, 3]
    return corners if np.isfinite(corners).all() else None
