"""Studio lighting: the default lamps of a preview, and a built-in environment for reflections.

The lamps are a key light, a fill light and a rim light, with dim hemispherical light. They follow
the camera, so that a mesh is lit the same way in every view. The environment is a gray room with
three soft lamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import Mesh
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Environment, Light, Lighting
from texbake.rendering.scene.material import Displacement, Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.cube_map import CubeMap, texel_directions
from texbake.texture.encoding import decode_srgb

# Name, direction in which the light travels as (right, up, back) of the camera, and radiance.
_LAMPS = (
    ("key", (0.65, -0.70, -0.40), (1.00, 0.97, 0.92)),
    ("fill", (-0.80, -0.10, -0.45), (0.22, 0.25, 0.30)),
    ("rim", (-0.35, -0.55, 0.80), (0.45, 0.47, 0.50)),
)

STUDIO = Lighting(
    lights=tuple(
        Light(name=name, direction=direction, color=color, follows_camera=True)
        for name, direction, color in _LAMPS
    ),
    ambient=Ambient(color=(0.16, 0.17, 0.19), ground=(0.06, 0.055, 0.05)),
)

# Between glossy and matte, so that both shading and highlights show the shape.
_ROUGHNESS = 0.5


def studio_scene(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    space: str | None = None,
    edge_px: float | None = Displacement.edge_px,
    options: RenderOptions | None = None,
) -> Scene:
    """Return a scene with one mesh and its maps in studio light."""
    options = options or RenderOptions()
    if normal_map is not None or displacement is not None or albedo is not None:
        mesh.corner_uvs()  # raises if there are none
    red, green, blue = decode_srgb(options.base_color).tolist()
    material = Material(name=mesh.name, base_color=(red, green, blue), roughness=_ROUGHNESS)
    if albedo is not None:
        material = replace(material, base_color=ImageTexture(image=albedo))
    if normal_map is not None:
        holder = NormalMap(texture=ImageTexture(image=normal_map), space=space)
        material = replace(material, normal_map=holder)
    if displacement is not None:
        heights = Displacement(texture=ImageTexture(image=displacement), edge_px=edge_px)
        material = replace(material, displacement=heights)
    item = SceneObject(mesh=mesh, material=material, name=mesh.name)
    return Scene(objects=(item,), lighting=STUDIO, name=mesh.name)


STUDIO_ROOM = "studio"
# Times the room: bright enough for metals, dim enough that the lamps still shade the rest.
_ROOM_SHARE, _ROOM_PX = 0.3, 128
# The same lamps with the room around them, which metals reflect.
_STUDIO_WITH_ROOM = Lighting(
    lights=STUDIO.lights,
    environment=Environment(
        image=STUDIO_ROOM, size=_ROOM_PX, background=False, lighting=True, intensity=_ROOM_SHARE
    ),
)


def lit_by_studio(scenes: Sequence[Scene]) -> list[Scene]:
    """Return scenes in the light of the studio, with its room if some material is a metal."""
    metals = any(item.material.metalness != 0.0 for scene in scenes for item in scene.objects)
    rig = _STUDIO_WITH_ROOM if metals else STUDIO
    changes = {"lights": rig.lights, "ambient": rig.ambient, "environment": rig.environment}
    return [scene.with_lighting(**changes) for scene in scenes]


# Radiance of the room at the top, at eye level and at the bottom.
_TOP, _MIDDLE, _BOTTOM = 0.55, 0.32, 0.14

# Lamps: azimuth (from +z toward +x) and elevation of the center in degrees, half width and half
# height as tangents, radiance.
_ROOM_LAMPS = (
    (40.0, 45.0, 0.45, 0.45, (7.0, 6.8, 6.5)),
    (-75.0, 15.0, 0.25, 0.70, (2.6, 2.8, 3.2)),
    (170.0, 35.0, 0.70, 0.20, (3.5, 3.4, 3.3)),
)

# Share of a lamp's half width over which its rim fades out.
_RIM = 0.08


def studio_room(size: int = 256) -> CubeMap:
    """Cube map of the studio room, +y up, with the strongest lamp at the front right."""
    directions = texel_directions(size).astype(np.float64)
    up = directions[..., 1]
    level = np.where(up > 0.0, _MIDDLE + (_TOP - _MIDDLE) * up, _MIDDLE + (_BOTTOM - _MIDDLE) * -up)
    light = np.repeat(level[..., None], 3, axis=-1)
    for azimuth, elevation, wide, tall, radiance in _ROOM_LAMPS:
        a, e = np.radians(azimuth), np.radians(elevation)
        middle = np.array([pm.sin(a) * pm.cos(e), pm.sin(e), pm.cos(a) * pm.cos(e)])
        right = np.array([pm.cos(a), 0.0, -pm.sin(a)])
        ahead = pm.matmul(directions, middle)
        away = np.where(ahead > 0.0, ahead, np.inf)
        x = np.abs(pm.matmul(directions, right)) / away / wide
        y = np.abs(pm.matmul(directions, np.cross(middle, right))) / away / tall
        shown = np.where(ahead > 0.0, np.maximum(x, y), np.inf)
        share = np.clip((1.0 - shown) / _RIM + 0.5, 0.0, 1.0)
        light += share[..., None] * (np.array(radiance) - light)
    return CubeMap(light.astype(np.float32))
