"""Transformation matrices of objects and of projectors.

An object's transform scales first, then rotates about x, y and z in that order, then translates. A
projector's matrix maps points in world space to positions in its picture.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992, for projectors.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera
from texbake.rendering.scene.lights import Vector
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import Image, read_header


def transform_matrix(
    *,
    translate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float | tuple[float, float, float] = 1.0,
) -> FloatArray:
    """(4, 4) float64: matrix that scales, rotates about x, y and z in that order, and translates.

    `translate`, in world units; `rotate`, in degrees, counter-clockwise seen from the tip of the
    axis.

    Examples
    --------
    >>> transform_matrix(rotate=(0, 90, 0), translate=(0, 5, 0)) @ [1, 0, 0, 1]
    array([ 0.,  5., -1.,  1.])
    """
    linear = np.diag(np.broadcast_to(np.asarray(scale, np.float64), 3))
    for axis, angle in enumerate(rotate):
        cosine, sine = _cos_sin(angle)
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = cosine
        turn[first, second], turn[second, first] = -sine, sine
        linear = pm.matmul(turn, linear)
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = translate
    return matrix


def _cos_sin(degrees: float) -> tuple[float, float]:
    quarters, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return pm.cos(math.radians(degrees)), pm.sin(math.radians(degrees))


# Share of the greatest stretch of a matrix below which its rays count as parallel, by rounding.
_PARALLEL = 1e-12

# Maps clip coordinates from -w to w to s and t from 0 to q; r and q are the depth.
_PICTURE_FROM_CLIP = np.array(
    [
        [0.5, 0.0, 0.0, 0.5],
        [0.0, 0.5, 0.0, 0.5],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def projector_matrix(
    *,
    position: Vector,
    target: Vector,
    up: Vector = (0.0, 1.0, 0.0),
    fov: float = 35.0,
    aspect: float = 1.0,
) -> FloatArray:
    """Matrix of a projector at a position that looks at a target.

    `position`, `target`, `up`: as for a camera, in world space; `fov`: vertical field of view in
    degrees. Returns (4, 4) float64.
    """
    if not 0.0 < aspect < math.inf:
        raise OptionError(f"aspect: {aspect} is not above 0; it is width over height")
    # The near plane does not affect s, t and q.
    camera = Camera.looking_at(position, target, up=up, fov=math.radians(fov), near=1.0)
    return pm.matmul(_PICTURE_FROM_CLIP, camera.clip_from_world(aspect))


def projector_position(matrix: FloatArray) -> FloatArray:
    """(3,): the point where s, t and q of a projector's matrix (4, 4) are all 0."""
    rows = np.asarray(matrix, np.float64)[[0, 1, 3]]
    sizes, _ = pm.svd(rows[:, :3])
    if not sizes[2] > _PARALLEL * sizes[0]:
        raise OptionError("matrix: its rays are parallel; leave out facing and occlusion")
    return np.asarray(-pm.solve(rows[:, :3], rows[:, 3]))


def picture_aspect(texture: ImageTexture) -> float:
    """Width over height of a texture's picture; a file's pixels are not read for this."""
    image = texture.image
    if isinstance(image, np.ndarray):
        height, width = image.shape[:2]
    elif isinstance(image, Image):
        height, width = image.pixels.shape[:2]
    else:
        header = read_header(image)
        width, height = header.width, header.height
    return float(width / height)
