"""Slide projectors: matrices that take points of the world to places of a picture.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera
from texbake.rendering.scene.lights import Vector
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import Image, read_header

# Clip coordinates, from -w to w, to s and t, from 0 to q; r and q are the depth.
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
    """Matrix of a projector that stands at a point and looks at another.

    Parameters
    ----------
    position, target, up
        As of a camera, in world space.
    fov : float
        Height of the picture, in degrees as seen from the projector.
    aspect : float
        Width of the picture over its height.

    Returns
    -------
    (4, 4) float64
        Takes (x, y, z, 1) to (s, t, r, q): (s / q, t / q) has (0, 0) and (1, 1) at the lower left
        and upper right corner of the picture; q and r are the depth along the view.

    Raises
    ------
    OptionError
        The projector stands on its target, looks along `up`, or throws no picture.
    """
    if not 0.0 < aspect < math.inf:
        raise OptionError(f"aspect: {aspect} is not above 0; it is width over height")
    # The near plane plays no part in s, t and q.
    camera = Camera.looking_at(position, target, up=up, fov=math.radians(fov), near=1.0)
    return _PICTURE_FROM_CLIP @ camera.clip_from_world(aspect)


def picture_aspect(texture: ImageTexture) -> float:
    """Width over height of the picture of a texture; of a file without reading its pixels."""
    image = texture.image
    if isinstance(image, np.ndarray):
        height, width = image.shape[:2]
    elif isinstance(image, Image):
        height, width = image.pixels.shape[:2]
    else:
        header = read_header(image)
        width, height = header.width, header.height
    return float(width / height)
