"""The simplest scene that looks the same: parts that change no pixel are removed before the plan.

Their own values say so, or the bounding boxes of objects for spot lights and projected pictures
that are aimed at nothing. What only the texels of an image would tell is not known here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import TexbakeError
from texbake.mesh.mesh import FloatArray
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.material_simplification import (
    Simplify,
    Step,
    Surroundings,
    is_hidden,
    simplifications,
    without_zeros,
)
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.projected import ProjectedTexture
from texbake.rendering.scene.scene import Scene, SceneObject

if TYPE_CHECKING:
    from texbake.rendering.effect import Effect

# Radians by which a cone counts as wider.
_ROUNDING = 1e-6


def lights_object(light: Light, item: SceneObject, camera: Camera | None = None) -> bool:
    """Whether the cone of a spot, which may follow the camera, may meet an object's sphere."""
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
        reach *= math.sqrt(2.0)  # the corner of a square cookie, the farthest of any
    cosine = float(pm.matmul(way, direction)) / (distance * float(pm.norm(direction)))
    angle = pm.arccos(min(max(cosine, -1.0), 1.0))
    return angle - pm.arcsin(radius / distance) <= pm.arctan(reach) + _ROUNDING


def hits_object(picture: ProjectedTexture, item: SceneObject) -> bool:
    """Whether a projected picture, with a margin of its size, may meet an object's bounding box.

    A file is opened for its aspect only if the result depends on it; an unreadable one is square.
    """
    corners = _corners(item)
    if corners is None:
        return True
    points = np.concatenate([corners, np.ones((8, 1))], 1).T
    matrix = picture.matrix
    if callable(matrix):
        square = matrix(aspect=1.0)
        if _misses_picture(square, points, across=False):
            return False
        try:
            matrix = picture.world_matrix
        except TexbakeError:
            matrix = square
    return not _misses_picture(matrix, points, across=True)


def _misses_picture(matrix: FloatArray, points: FloatArray, *, across: bool) -> bool:
    """Whether all points (4, n) are behind a projector or beyond one side of its picture."""
    with np.errstate(over="ignore", invalid="ignore"):
        s, t, _, q = pm.matmul(matrix, points)
        beyond = [q <= 0.0, t < -q, t > 2.0 * q]
        beyond += [s < -q, s > 2.0 * q] if across else []
    return any(side.all() for side in beyond)


def _corners(item: SceneObject) -> FloatArray | None:
    """(8, 3): corners of the bounding box in the world; None for a surface that leaves its box."""
    corners = item.box_corners()
    has_box = item.material.displacement is None and np.isfinite(corners).all()
    return corners if has_box else None


@dataclass(frozen=True)
class SkippedEffect:
    """An effect, or one target of it, that is not in the plan."""

    name: str  # name of the effect, or of the map
    requested_by: str  # the part that it belongs to: `object "vase"`, `the scene`
    why: str


def simplify_scene(
    scene: Scene,
    options: RenderOptions,
    effects: Sequence[Effect],
    *,
    keeps_materials: bool = False,
) -> tuple[Scene, RenderOptions, tuple[SkippedEffect, ...]]:
    """Return a scene and its options without what changes no pixel, and what that was."""
    found: list[SkippedEffect] = []
    original = scene
    zeros = (partial(without_zeros, effects),)
    objects = tuple(_simplify_object(item, zeros, found) for item in scene.objects)
    scene = replace(scene, objects=objects)
    lights = _active_lights(scene, found)
    lighting, options = _active_lighting(replace(scene.lighting, lights=lights), options, found)
    around = None if keeps_materials else _surroundings(scene, lighting)
    objects = tuple(_active_object(scene, item, lighting, around, found) for item in scene.objects)
    if not found:
        return original, options, ()
    return replace(scene, objects=objects, lighting=lighting), options, tuple(found)


def _simplify_object(
    item: SceneObject, steps: Iterable[Simplify], found: list[SkippedEffect]
) -> SceneObject:
    material = item.material
    for step in steps:
        for name, why, simpler in step(material):
            if why:
                found.append(SkippedEffect(name, f'object "{item.name}"', why))
            material = simpler
    return item if material is item.material else replace(item, material=material)


def _active_lights(scene: Scene, found: list[SkippedEffect]) -> tuple[Light, ...]:
    """Lights, of which spots that shine past all objects are dark."""
    active = []
    for light in scene.lighting.lights:
        if (
            light.kind != "spot"
            or light.follows_camera
            or not light.shines
            or any(lights_object(light, item) for item in scene.objects)
        ):
            active.append(light)
        else:
            found.append(
                SkippedEffect("lights", f'light "{light.name}"', "its cone meets no object")
            )
            active.append(replace(light, intensity=0.0, profile=None, shadow=None))
    return tuple(active)


def _active_lighting(
    lighting: Lighting, options: RenderOptions, found: list[SkippedEffect]
) -> tuple[Lighting, RenderOptions]:
    """Leave out an environment that is dark; where it was seen, the background is black."""
    environment = lighting.environment
    if environment is None:
        return lighting, options
    is_black = environment.image is None and not environment.faces and not any(environment.color)
    if environment.intensity != 0.0 and not is_black:
        return lighting, options
    why = "the environment is black" if is_black else "the environment's intensity is 0"
    found.append(SkippedEffect("environment", "the scene", why))
    if environment.background:
        options = replace(options, background=(0.0, 0.0, 0.0))
    return replace(lighting, environment=None), options


def _surroundings(scene: Scene, lighting: Lighting) -> Surroundings:
    ambient, environment = lighting.ambient, lighting.environment
    lamps = any(light.shines for light in lighting.lights)
    environment_light = environment is not None and environment.lighting
    return Surroundings(
        lamps=lamps,
        ambient=ambient.shines,
        environment_light=environment_light,
        even=not (lamps or environment_light) and ambient.ground in (None, ambient.color),
        environment=environment is not None,
        other_objects=len(scene.objects) > 1,
    )


def _active_object(
    scene: Scene,
    item: SceneObject,
    lighting: Lighting,
    around: Surroundings | None,
    found: list[SkippedEffect],
) -> SceneObject:
    steps: list[Simplify] = [partial(_without_stray_pictures, item)]
    if around is not None:
        colors = item.mesh.colors if item.material.vertex_colors else None
        vertex_opacity = colors is not None and colors.shape[1] == 4
        steps += simplifications(around, vertex_opacity=vertex_opacity)
    return _simplify_object(
        item, [*steps, partial(_without_unseen_relief, scene, item, lighting)], found
    )


def _without_unseen_relief(
    scene: Scene, item: SceneObject, lighting: Lighting, material: Material
) -> Iterator[Step]:
    counts = _may_be_seen(scene, item, material) or _casts_shadows(scene, item, lighting)
    if material.displacement is not None and not counts:
        why = "the object is not seen and casts no shadow"
        yield "displacement", why, replace(material, displacement=None)


def _may_be_seen(scene: Scene, item: SceneObject, material: Material) -> bool:
    """Whether an object may be seen by the camera or in a mirror."""
    if is_hidden(material):
        return False
    materials = [each.material for each in scene.objects]
    mirrors = [each for m in materials for each in (m.reflection, m.refraction)]
    return item.visible or any(
        mirror is not None and mirror.environment == "rendered" for mirror in mirrors
    )


def _casts_shadows(scene: Scene, item: SceneObject, lighting: Lighting) -> bool:
    pictures = [
        picture
        for each in scene.objects
        if _may_be_seen(scene, each, each.material)
        for picture in each.material.projected
    ]
    return item.casts_shadows and (
        any(light.shadow is not None and light.shines for light in lighting.lights)
        or any(picture.occlusion and picture.strength != 0.0 for picture in pictures)
    )


def _without_stray_pictures(item: SceneObject, material: Material) -> Iterator[Step]:
    strong = tuple(picture for picture in material.projected if picture.strength != 0.0)
    aimed = tuple(picture for picture in strong if hits_object(picture, item))
    if len(aimed) < len(material.projected):
        was_weak = len(strong) < len(material.projected)
        why = "the strength of a picture is 0" if was_weak else "a picture is aimed elsewhere"
        yield "projected textures", why, replace(material, projected=aimed)
