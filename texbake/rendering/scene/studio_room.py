"""An environment without a file: a gray room with three soft lamps, for surfaces that mirror."""

from __future__ import annotations

import numpy as np

from texbake.texture.cube_map import CubeMap, texel_directions

STUDIO_ROOM = "studio"

# Radiance of the room at its top, at the height of the eye and at its bottom.
_TOP, _MIDDLE, _BOTTOM = 0.55, 0.32, 0.14
# Lamps: azimuth from +z toward +x and elevation of the middle in degrees, half width and half
# height as tangents, radiance.
_LAMPS = (
    (40.0, 45.0, 0.45, 0.45, (7.0, 6.8, 6.5)),
    (-75.0, 15.0, 0.25, 0.70, (2.6, 2.8, 3.2)),
    (170.0, 35.0, 0.70, 0.20, (3.5, 3.4, 3.3)),
)
# Share of a lamp's half width over which it fades at its rim.
_RIM = 0.08


def studio_room(size: int = 256) -> CubeMap:
    """Cube map of a room, +y up, the strongest lamp in front on the right.

    Parameters
    ----------
    size
        Texels along one side of a face.
    """
    directions = texel_directions(size).astype(np.float64)
    up = directions[..., 1]
    level = np.where(up > 0.0, _MIDDLE + (_TOP - _MIDDLE) * up, _MIDDLE + (_BOTTOM - _MIDDLE) * -up)
    light = np.repeat(level[..., None], 3, axis=-1)
    for azimuth, elevation, wide, tall, radiance in _LAMPS:
        a, e = np.radians(azimuth), np.radians(elevation)
        middle = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        ahead = directions @ middle
        away = np.where(ahead > 0.0, ahead, np.inf)
        x = np.abs(directions @ right) / away / wide
        y = np.abs(directions @ np.cross(middle, right)) / away / tall
        shown = np.where(ahead > 0.0, np.maximum(x, y), np.inf)
        share = np.clip((1.0 - shown) / _RIM + 0.5, 0.0, 1.0)
        light += share[..., None] * (np.array(radiance) - light)
    return CubeMap(light.astype(np.float32))
