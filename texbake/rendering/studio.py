"""The light of a preview that names none: a key light, a fill, a rim, and a dim hemisphere.

The lamps hang on the camera, so that a mesh is lit alike from every side that it is seen from.
"""

from __future__ import annotations

from texbake.mesh.mesh import Mesh
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Displacement, Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb

# Name, direction that the light goes as (right, up, back) of the camera, and radiance.
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
# Neither glossy nor dull, so that form is told by shade and highlight alike.
_ROUGHNESS = 0.5


def studio_scene(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    edge_px: float | None = Displacement.edge_px,
    options: RenderOptions | None = None,
) -> Scene:
    """Return a scene of one mesh with its maps, under the light of the studio.

    Parameters
    ----------
    mesh
        Any mesh; maps need texture coordinates.
    normal_map, displacement, albedo
        As in `texbake.rendering.render.render`.
    edge_px
        Longest edge of displaced pieces in the picture; None: cut to texels, once for all pictures.
    options
        `base_color` and `filter` are taken from it.
    """
    options = options or RenderOptions()
    if normal_map is not None or displacement is not None or albedo is not None:
        mesh.corner_uvs()  # raises where there are none
    red, green, blue = decode_srgb(options.base_color)
    material = Material(
        name=mesh.name,
        base_color=(float(red), float(green), float(blue))
        if albedo is None
        else ImageTexture(image=albedo),
        roughness=_ROUGHNESS,
        normal_map=None
        if normal_map is None
        else NormalMap(texture=ImageTexture(image=normal_map)),
        displacement=None
        if displacement is None
        else Displacement(texture=ImageTexture(image=displacement), edge_px=edge_px),
    )
    return Scene(
        objects=(SceneObject(mesh=mesh, material=material, name=mesh.name),),
        lighting=STUDIO,
        name=mesh.name,
    )
