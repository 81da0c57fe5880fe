"""Parts of a scene whose own values say that they change no pixel: a strength of 0, a black color.

They are taken out before the picture is planned, so that nothing is read or computed for them. So
are spot lights and projected pictures that are aimed at nothing, by the bounding boxes of objects.
What only the texels of an image would tell, such as a height map of one height, is not known here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.rendering.maps import normal_space
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Material, ProjectedTexture
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture, Slot

# Radians by which a cone counts as wider.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Identity:
    """A part of a scene that was taken out.

    Attributes
    ----------
    name : str
        Name of the effect that it would call for, or of the map.
    by : str
        The part that it belongs to: `object "vase"`, `the scene`.
    why : str
    """

    name: str
    by: str
    why: str


def without_identities(
    scene: Scene, *, reads_coordinates: bool = False
) -> tuple[Scene, tuple[Identity, ...]]:
    """Return a scene without the parts that change no pixel, and what these were.

    `reads_coordinates` says whether something else than materials may look up texture coordinates,
    such as a buffer that is shown or an effect of the caller's own.
    """
    found: list[Identity] = []
    lights = _active_lights(scene, found)
    lighting = replace(_active_lighting(scene.lighting, found), lights=lights)
    objects = []
    for item in scene.objects:
        changes: dict[str, Any] = {}
        for name, part, why, value in _identities(item, lighting, reads_coordinates):
            found.append(Identity(name, f'object "{item.name}"', why))
            changes[part] = value
        material = replace(item.material, **changes) if changes else item.material
        objects.append(replace(item, material=material) if changes else item)
    if not found:
        return scene, ()
    return replace(scene, objects=tuple(objects), lighting=lighting), tuple(found)


def _active_lights(scene: Scene, found: list[Identity]) -> tuple[Light, ...]:
    """Lights, of which spots that shine past all objects are dark."""
    active = []
    for light in scene.lighting.lights:
        if (
            light.kind != "spot"
            or light.follows_camera
            or light.intensity == 0.0
            or any(_meets(light, item) for item in scene.objects)
        ):
            active.append(light)
        else:
            found.append(Identity("lights", f'light "{light.name}"', "its cone meets no object"))
            active.append(replace(light, intensity=0.0, profile=None, shadow=None))
    return tuple(active)


def _meets(light: Light, item: SceneObject) -> bool:
    """Whether the cone of a spot may meet the bounding sphere of an object."""
    corners = _corners(item)
    if corners is None:
        return True
    center = corners.mean(axis=0)
    radius = float(np.linalg.norm(corners - center, axis=1).max())
    way = center - np.asarray(light.position, np.float64)
    distance = float(np.linalg.norm(way))
    if not radius < distance < math.inf:
        return True
    reach = math.tan(math.radians(light.angle) / 2.0)
    if light.profile is not None and light.gate == "rectangle":
        reach *= math.sqrt(2.0)  # the corner of a square slide, the farthest of any
    direction = np.asarray(light.direction, np.float64)
    cosine = float(way @ direction) / (distance * float(np.linalg.norm(direction)))
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    return angle - math.asin(radius / distance) <= math.atan(reach) + _ROUNDING


def _hits(picture: ProjectedTexture, item: SceneObject) -> bool:
    """Whether a projected picture, and as much around it, may meet an object's bounding box."""
    corners = _corners(item)
    if corners is None:
        return True
    with np.errstate(over="ignore", invalid="ignore"):
        s, t, _, q = np.asarray(picture.matrix) @ np.concatenate([corners, np.ones((8, 1))], 1).T
        beyond = [q <= 0.0, s < -q, s > 2.0 * q, t < -q, t > 2.0 * q]
    return not any(side.all() for side in beyond)


def _corners(item: SceneObject) -> FloatArray | None:
    """(8, 3): corners of the bounding box in the world; None for a surface that leaves its box."""
    if item.material.displacement is not None:
        return None
    corners = item.box_corners()
    if item.transform is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            corners = corners @ item.transform[:3, :3].T + item.transform[:3, 3]
    return corners if np.isfinite(corners).all() else None


def _active_lighting(lighting: Lighting, found: list[Identity]) -> Lighting:
    environment = lighting.environment
    if environment is None or not environment.lighting:
        return lighting
    is_black = environment.image is None and not environment.faces and not any(environment.color)
    if environment.intensity != 0.0 and not is_black:
        return lighting
    why = "the environment is black" if is_black else "the environment's intensity is 0"
    found.append(Identity("environment light", "the scene", why))
    return replace(lighting, environment=replace(environment, lighting=False))


def _identities(
    item: SceneObject, lighting: Lighting, reads_coordinates: bool
) -> Iterator[tuple[str, str, str, Any]]:
    """Yield the name, field and reason of parts that change nothing, and what takes their place."""
    material = item.material
    for name, part, test in _TESTS:
        if getattr(material, part) is not None and (why := test(material)):
            yield name, part, why, None
    for slot, zero in _ZEROS.items():
        value = getattr(material, slot)
        if isinstance(value, ImageTexture | ProcedureTexture) and _is_black(value):
            if slot == "base_color" and _may_hold_opacity(material):
                continue
            kind = "images" if isinstance(value, ImageTexture) else "procedures"
            yield kind, slot, f"the factor of {slot} is 0", zero
    moves = material.parallax is not None and material.parallax.depth != 0.0
    if moves and not reads_coordinates and not _looks_up_coordinates(material):
        yield "parallax", "parallax", "its material looks up nothing at texture coordinates", None
    if material.occlusion is not None and (why := _unoccluded(material, lighting)):
        yield "occlusion map", "occlusion", why, None
    strong = tuple(picture for picture in material.projected if picture.strength != 0.0)
    aimed = tuple(picture for picture in strong if _hits(picture, item))
    if len(strong) < len(material.projected):
        yield "projected textures", "projected", "the strength of a picture is 0", aimed
    elif len(aimed) < len(strong):
        yield "projected textures", "projected", "a picture is aimed elsewhere", aimed


def _looks_up_coordinates(material: Material) -> bool:
    """Whether a texture of a material, but for the parallax map, lies on texture coordinates."""
    holders = [material, material.normal_map, material.bump_map, material.reflection,
               material.refraction]  # fmt: skip
    values = [
        getattr(holder, item.name)
        for holder in holders
        if holder is not None
        for item in fields(holder)
    ]
    return any(
        isinstance(value, ImageTexture)
        or (isinstance(value, ProcedureTexture) and value.space == "uv")
        for value in values
    )


def _unoccluded(material: Material, lighting: Lighting) -> str:
    ambient, environment = lighting.ambient, lighting.environment
    if material.occlusion_strength == 0.0:
        return "its strength is 0"
    if any(ambient.color) or any(ambient.ground or ()):
        return ""
    return "" if environment is not None and environment.lighting else "there is no ambient light"


def _flat_normals(material: Material) -> str:
    holder = material.normal_map
    assert holder is not None
    if holder.strength != 0.0:
        return ""
    # In other spaces the strength does not count; the header of the file may say which.
    space = holder.space or normal_space(holder.texture.image)
    return "its strength is 0" if space == "tangent" else ""


def _no_bumps(material: Material) -> str:
    assert material.bump_map is not None
    return "its height is 0" if material.bump_map.height == 0.0 else ""


def _no_displacement(material: Material) -> str:
    assert material.displacement is not None
    return "its height is 0" if material.displacement.height == 0.0 else ""


def _no_parallax(material: Material) -> str:
    assert material.parallax is not None
    return "its depth is 0" if material.parallax.depth == 0.0 else ""


def _no_reflection(material: Material) -> str:
    assert material.reflection is not None
    if material.reflection.fresnel:  # it grows toward grazing angles whatever the strength
        return ""
    return "its strength is 0" if _is_black(material.reflection.strength) else ""


def _no_refraction(material: Material) -> str:
    assert material.refraction is not None
    return "its strength is 0" if _is_black(material.refraction.strength) else ""


def _no_emission(material: Material) -> str:
    return "it is black" if _is_black(material.emission) else ""


def _no_light_map(material: Material) -> str:
    return "it is black" if _is_black(material.light_map) else ""


def _may_hold_opacity(material: Material) -> bool:
    """Whether the image of the base color may have a fourth channel that counts."""
    texture = material.base_color
    return (
        isinstance(texture, ImageTexture)
        and material.alpha_mode != "opaque"
        and texture.channel is None
        and not texture.colors
    )


def _is_black(slot: Slot | None) -> bool:
    """Whether all values of a slot are 0 because its constant or its factor is."""
    value = slot.factor if isinstance(slot, ImageTexture | ProcedureTexture) else slot
    return value is not None and not np.any(np.asarray(value))


# What takes the place of a texture whose factor is 0.
_ZEROS: Mapping[str, float | tuple[float, float, float]] = MappingProxyType(
    {
        "base_color": (0.0, 0.0, 0.0), "specular": (0.0, 0.0, 0.0), "exponent": 0.0, "gloss": 0.0,
        "roughness": 0.0, "metalness": 0.0, "opacity": 0.0,
    }
)  # fmt: skip
# Effect, field of the material, and why it changes nothing: "" if it may.
_TESTS: tuple[tuple[str, str, Callable[[Material], str]], ...] = (
    ("normal map", "normal_map", _flat_normals),
    ("bump map", "bump_map", _no_bumps),
    ("displacement", "displacement", _no_displacement),
    ("parallax", "parallax", _no_parallax),
    ("reflection", "reflection", _no_reflection),
    ("refraction", "refraction", _no_refraction),
    ("emission", "emission", _no_emission),
    ("light map", "light_map", _no_light_map),
)
