"""Reflection and refraction of an environment: the scene's own, or one rendered from the scene.

A mirror shows the environment in the direction 2 (N·V) N - V. Glass shows it in the view direction
refracted once by Snell's law; on total internal reflection it acts as a mirror. The reflected or
refracted share replaces the surface's own light. The environment is looked up by direction alone,
as if it were infinitely far away.

A rendered environment is a cube map of the other objects in front of the scene's environment, taken
from the center of the object that shows it. Objects in it may show rendered environments of their
own, nested `options.bounces` deep; beyond that they show the scene's environment, or black. Two
facing mirrors thus show a limited number of reflections.

Based on: Blinn and Newell, "Texture and reflection in computer generated images", CACM 19(10),
1976; Greene, "Environment mapping and other applications of world projections", 1986; Schlick, "An
inexpensive BRDF model for physically-based rendering", 1994.

Kernel: `core/surrounding_light.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array
from texbake.rendering.camera import Camera
from texbake.rendering.effect import Effect, Rejection, RenderState
from texbake.rendering.effects.environment import PlacedEnvironment, environment_map
from texbake.rendering.effects.lights import fix_in_world
from texbake.rendering.effects.shading_models import normals_effect
from texbake.rendering.effects.slots import slot_values
from texbake.rendering.fragments import Fragments
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import Material, Reflection, Refraction
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.cube_map import CubeChain, CubeMap, cube_face_axes

# Near plane of a rendered environment, relative to the size of its object.
_NEAR = 1e-3


def _mirrors(material: Material) -> Iterator[tuple[str, Reflection | Refraction]]:
    """Yield the reflection and the refraction of a material, where it has them."""
    for name in "reflection", "refraction":
        mirror = getattr(material, name)
        if mirror is not None:
            yield name, mirror


def _needs(name: str, request: RenderRequest, target: int) -> Iterator[str]:
    mirror: Reflection | Refraction = getattr(request.material(target), name)
    is_rendered = mirror.environment == "rendered" and not _why_not_rendered(request)
    if request.scene.lighting.environment is not None and not is_rendered:
        yield "environment"
    if isinstance(mirror.strength, ImageTexture | ProcedureTexture):
        yield mirror.strength.effect


def _rendered_reasons(request: RenderRequest, index: int) -> Iterator[str | Rejection]:
    for name, mirror in _mirrors(request.material(index)):
        if mirror.environment == "rendered":
            why_not = _why_not_rendered(request)
            yield Rejection(why_not) if why_not else f"its {name} is of the scene around it"


def _without_rendered(material: Material) -> Material:
    changes: dict[str, Any] = {
        name: replace(mirror, environment="scene") for name, mirror in _mirrors(material)
    }
    return replace(material, **changes)


def _why_not_rendered(request: RenderRequest) -> str:
    """Say why no environment is rendered; "" if one may be."""
    if request.depth > request.options.bounces:
        return f"{request.depth} reflections are enough"
    return "the scene has no other object to show" if len(request.scene.objects) == 1 else ""


def _fixed_environment(state: RenderState, target: int) -> PlacedEnvironment | None:
    """Render an object's environment once for all cameras, unless a light follows the camera."""
    return None if any(light.follows_camera for light in state.lights) else _render(state, target)


def _rendered_environment(state: RenderState, target: int) -> PlacedEnvironment:
    return state.of(_fixed_environment, target) or _render(state, target)


def _render(state: RenderState, target: int) -> PlacedEnvironment:
    """Render the other objects into a cube map at the center of the object's bounding box."""
    positions = state.drawn(target).positions
    low, high = positions.min(axis=0), positions.max(axis=0)
    extent = float(pm.norm(high - low))
    size = max(mirror.size for _, mirror in _mirrors(state.request.material(target)))
    cameras = [
        Camera(
            eye=0.5 * low + 0.5 * high,
            axes=cube_face_axes(face),
            fov=math.pi / 2.0,
            near=_NEAR * extent if extent > 0.0 else _NEAR,
        )
        for face in range(6)
    ]
    # A mirror shows all objects but itself. Other mirrors may show it, too.
    around = tuple(replace(item, visible=i != target) for i, item in enumerate(state.scene.objects))
    options = replace(
        state.options, width=size, height=size, supersampling=1, background=(0.0, 0.0, 0.0)
    )
    lights = tuple(fix_in_world(light, state.camera) for light in state.lights)
    scene = replace(
        state.scene, objects=around, lighting=replace(state.scene.lighting, lights=lights)
    )
    views = state.draw_others(scene, cameras, options)
    cube = CubeMap.from_views(np.stack([view[..., :3] for view in views]))
    return PlacedEnvironment(CubeChain.of([cube]), np.eye(3))


def _mix(fragments: Fragments, state: RenderState, name: str, directions: Float32Array) -> None:
    """Replace a share of the fragments' light by the environment's."""
    mirror = getattr(fragments.drawn.material, name)
    environment = state.get(environment_map)  # None is black
    if mirror.environment == "rendered":
        environment = state.get(_rendered_environment, fragments.target) or environment
    strength = slot_values(fragments, state, f"{name}.strength", mirror.strength, 3)
    seen = np.zeros_like(directions) if environment is None else environment.look(directions)
    core.mix_in_environment(
        fragments.normals, fragments.to_eye, strength, seen, getattr(mirror, "fresnel", False),
        fragments.light,
    )  # fmt: skip


def _reflect(fragments: Fragments, state: RenderState) -> None:
    directions = np.empty_like(fragments.normals)
    core.mirror_directions(fragments.normals, fragments.to_eye, directions)
    _mix(fragments, state, "reflection", directions)


def _refract(fragments: Fragments, state: RenderState) -> None:
    directions = np.empty_like(fragments.normals)
    refraction = fragments.drawn.material.refraction
    assert refraction is not None
    core.refract_directions(
        fragments.normals, fragments.to_eye, fragments.back_facing, float(refraction.ior),
        directions,
    )  # fmt: skip
    _mix(fragments, state, "refraction", directions)


RENDERED_ENVIRONMENT = Effect(
    name="rendered environment",
    does="renders a cube map of the scene around an object",
    after="prefiltered environment",
    reasons=_rendered_reasons,
    without=lambda scene: scene.with_materials(_without_rendered),
    left_out="no material in the picture reflects or refracts the scene around it",
    load=_fixed_environment,
    of_the_others=True,
    prepare=_rendered_environment,
)

REFRACTION = Effect(
    name="refraction",
    does="adds what is seen through glass",
    after="vertex light",
    material_field="refraction",
    strength="strength",
    why="its material has a refraction",
    left_out="no material in the picture refracts",
    needs=(normals_effect, "view directions", partial(_needs, "refraction")),
    shade=_refract,
    rate="pixel",
)

REFLECTION = Effect(
    name="reflection",
    does="adds what a mirror reflects",
    after="refraction",
    material_field="reflection",
    strength="strength",
    why="its material has a reflection",
    left_out="no material in the picture reflects",
    needs=(normals_effect, "view directions", partial(_needs, "reflection")),
    shade=_reflect,
    rate="pixel",
)
