"""How far a picture is from another, and small pictures that show what a setting does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import Mesh
from texbake.rendering.camera import Camera
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render
from texbake.texture.encoding import encode_srgb

FloatImage = npt.NDArray[np.float32]

# Pixels a side of the crops.
CROP = 200
_ZOOM = 4.0


def picture_error(
    picture: FloatImage, truth: FloatImage, where: npt.NDArray[np.bool_] | None = None
) -> float:
    """Root mean square difference in 8-bit steps of what a screen shows, of 255.

    Parameters
    ----------
    picture, truth : (H, W, 3 or 4) float32
        Linear light; a fourth channel is not looked at.
    where : (H, W) bool, optional
        Pixels that count.
    """
    difference = 255.0 * (
        encode_srgb(picture[..., :3]).astype(np.float64) - encode_srgb(truth[..., :3])
    )
    squares = np.square(difference).mean(axis=-1)
    return float(np.sqrt(squares.mean() if where is None else squares[where].mean()))


def close_up(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    zoom: float = _ZOOM,
    threads: int | None = None,
) -> FloatImage:
    """(CROP, CROP, 3) float32: the middle of a mesh with its maps, from near by."""
    options = RenderOptions(width=CROP, height=CROP, supersampling=2)
    camera = Camera.framing(mesh, options=options)
    near = replace(camera, fov=2.0 * math.atan(math.tan(camera.fov / 2.0) / zoom))
    frame = render(
        mesh,
        normal_map=normal_map,
        displacement=displacement,
        options=options,
        camera=near,
        threads=threads,
    )
    return frame.color[..., :3]


def crop(
    picture: FloatImage, center: tuple[float, float] = (0.5, 0.5), zoom: int = 1
) -> FloatImage:
    """(CROP, CROP, 3): a part of a picture, each pixel drawn `zoom` times as wide and high.

    `center` is in shares of the width and the height, from the upper left; the part is moved so
    that it lies inside the picture. A smaller picture is drawn larger until it fills the crop.
    """
    height, width = picture.shape[:2]
    zoom = max(zoom, math.ceil(CROP / min(height, width)))
    side = math.ceil(CROP / zoom)
    left, top = (
        round(min(max(share * size - side / 2, 0.0), size - side))
        for share, size in zip(center, (width, height), strict=True)
    )
    part = picture[top : top + side, left : left + side, :3]
    return np.ascontiguousarray(part.repeat(zoom, axis=0).repeat(zoom, axis=1)[:CROP, :CROP])
