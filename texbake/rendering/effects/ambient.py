"""Ambient light, ambient occlusion, emission and light maps.

Ambient light is the base color times a blend of the light from above and from below, weighted by
how far the normal points up. Metals use their base color too, instead of a reflection. Emission
adds the value of its slot. A light map adds the value of its slot times the diffuse color.

Ambient occlusion is two effects. The first computes a screen-space picture of the occlusion by
nearby surfaces from the camera's depths. The second looks up the unoccluded share for each fragment
and multiplies ambient and environment light by it. `texbake/core/ambient_occlusion.c` describes
the algorithm.

Kernels: `core/surrounding_light.c`, `core/ambient_occlusion.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array
from texbake.parallel import run_bands
from texbake.rendering.effect import Activation, Effect, Rejection, RenderState
from texbake.rendering.effects.shading_models import normals_effect
from texbake.rendering.fragments import Fragments, one_row
from texbake.rendering.material_simplification import is_diffuse, reflects_environment
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target
from texbake.rendering.scene.lights import Ambient
from texbake.texture.image import FloatImage

# Default radius, as a share of half the diagonal of the scene's bounding box.
_RADIUS = 0.2
# Rows of pixels per band.
_ROWS = 16


def _occlusion_activations(request: RenderRequest) -> Iterator[Activation | Rejection]:
    lighting = request.scene.lighting
    if lighting.occlusion is None:
        return
    ambient = lighting.ambient.shines
    around = lighting.environment is not None and lighting.environment.lighting
    if not (ambient or around):
        yield Rejection("it has no ambient light to darken", "the scene")
    elif lighting.occlusion.strength == 0.0:
        yield Rejection("its strength is 0", "the scene")
    else:
        for index in request.lit:
            material = request.material(index)
            if material.shading_rate == "vertex":
                yield Rejection("it is shaded per vertex", request.name(index))
            elif (ambient and is_diffuse(material)) or (around and reflects_environment(material)):
                yield Activation(index, request.name(index), "the scene has ambient occlusion")


def _occlusion_shares(state: RenderState, target: Target) -> FloatImage:
    """(H, W) float32: unoccluded share of ambient light at each pixel's surface."""
    occlusion = state.scene.lighting.occlusion
    assert occlusion is not None
    visibility, world, camera = state.visible.visibility, state.world, state.camera
    height, width = state.options.height, state.options.width
    side = state.options.supersampling
    places, normals = np.zeros((height, width, 3)), np.zeros((height, width, 3))
    rough = np.ones((height, width), np.float32)
    smooth = np.empty((height, width), np.float32)
    rays = camera.view_rays(width, height)
    radius = occlusion.radius
    if radius is None:
        extent = world.positions.max(axis=0) - world.positions.min(axis=0)
        radius = _RADIUS * 0.5 * float(pm.norm(extent)) or 1.0
    n_slices = max(2, round(math.sqrt(occlusion.samples / 2.0)))
    n_steps = max(1, math.ceil(occlusion.samples / (2 * n_slices)))
    per_unit = 0.5 * height / pm.tan(camera.fov / 2.0)

    kernels = (
        partial(core.find_places, visibility.face_ids, visibility.depths, side, camera.near,
                world.positions, world.faces, rays, places, normals),
        partial(core.find_arriving_shares, places, normals, camera.axes[0], camera.axes[1],
                per_unit, float(radius), n_slices, n_steps, rough),
        partial(core.smooth_shares, rough, places, normals, float(radius), smooth),
    )  # fmt: skip
    for kernel in kernels:
        run_bands(kernel, height, band=_ROWS, threads=state.threads)
    return np.float32(1.0) - np.float32(occlusion.strength) * (np.float32(1.0) - smooth)


def _hold_back(fragments: Fragments, state: RenderState) -> None:
    fragments.ambient_share = state.of(_occlusion_shares).ravel()[fragments.pixels]


OCCLUSION_PICTURE = Effect(
    name="occlusion picture",
    does="computes ambient occlusion from depths",
    after="layers",
    of="picture",
    left_out="the scene has no ambient occlusion",
    prepare=_occlusion_shares,
)

AMBIENT_OCCLUSION = Effect(
    name="ambient occlusion",
    does="darkens ambient light near other surfaces",
    after="unlit",
    activations=_occlusion_activations,
    left_out="the scene has no ambient occlusion",
    needs=("occlusion picture",),
    without=lambda scene: scene.with_lighting(occlusion=None),
    shade=_hold_back,
    rate="pixel",
)


def _normals_for_ambient(request: RenderRequest, target: int) -> Iterator[str]:
    if request.scene.lighting.ambient.ground is not None:
        yield normals_effect(request, target)


def arriving_share(fragments: Fragments) -> Float32Array:
    """(n or 1,) float32: share of ambient light that is not occluded by the scene or by a map."""
    occlusion = fragments.values.occlusion
    if occlusion is None:
        return fragments.ambient_share
    strength = np.float32(fragments.drawn.material.occlusion_strength)
    kept = np.float32(1.0) + strength * (occlusion[:, 0] - np.float32(1.0))
    return np.ascontiguousarray(fragments.ambient_share * kept, np.float32)


def add_ambient(
    ambient: Ambient,
    up: str,
    normals: Float32Array,
    base: Float32Array,
    share: Float32Array,
    light: Float32Array,
) -> None:
    """Add to `light` (n, 3) the unoccluded share of ambient light that base colors reflect."""
    two_sided = ambient.ground is not None and len(normals) > 0
    core.reflect_ambient(
        normals if two_sided else np.empty((0, 3), np.float32),
        np.array([0.0, 1.0, 0.0] if up == "y" else [0.0, 0.0, 1.0]),
        one_row(ambient.color, 3),
        one_row(ambient.color if ambient.ground is None else ambient.ground, 3),
        base,
        share,
        light,
    )


def _add_ambient(fragments: Fragments, state: RenderState) -> None:
    add_ambient(
        state.scene.lighting.ambient,
        state.options.up,
        fragments.normals,
        fragments.values.base_color,
        arriving_share(fragments),
        fragments.light,
    )


def _emit(fragments: Fragments, state: RenderState) -> None:
    assert fragments.values.emission is not None
    fragments.light += fragments.values.emission


def _add_light_map(fragments: Fragments, state: RenderState) -> None:
    scattered = fragments.values.base_color
    if fragments.values.metalness is not None:
        scattered = scattered * (1.0 - fragments.values.metalness)
    assert fragments.values.light_map is not None
    fragments.light += fragments.values.light_map * scattered


AMBIENT = Effect(
    name="ambient",
    does="adds ambient light",
    after="ambient occlusion",
    among="lit",
    when=lambda request, index: (
        request.scene.lighting.ambient.shines and is_diffuse(request.material(index))
    ),
    why="the scene has ambient light",
    left_out="the scene has no ambient light, or nothing that it falls on",
    needs=("slots", _normals_for_ambient),
    without=lambda scene: scene.with_lighting(ambient=Ambient()),
    shade=_add_ambient,
    rate="vertex",
)

LIGHT_MAP = Effect(
    name="light map",
    does="adds baked light",
    after="emboss",
    material_field="light_map",
    strength="",
    among="lit",
    why="its material has a light map",
    left_out="no lit material in the picture has a light map",
    needs=("slots",),
    shade=_add_light_map,
    rate="pixel",
)

EMISSION = Effect(
    name="emission",
    does="adds light that surfaces emit",
    after="reflection",
    material_field="emission",
    strength="",
    why="its material emits light",
    left_out="no material in the picture emits light",
    needs=("slots",),
    shade=_emit,
    rate="pixel",
)
