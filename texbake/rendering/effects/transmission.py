"""Transmission: what lies behind a surface, seen through it, tinted, bent and blurred.

The share t of a surface's light that is not mirrored and not metal comes from behind it instead of
being scattered. Where the mirrored share is Schlick's F, the surface shows

    (1 - F) (1 - metalness) ((1 - t) scattered + t C_b T behind) + mirrored

`behind` is looked up in a picture of the scene without all transmissive objects, from the same
camera. A surface without `thickness` is a thin sheet, which does not bend light: it shows the pixel
behind it. With `thickness`, the line of sight is refracted once and followed that far; where it
ends is looked up, and the volume absorbs T = attenuation_color ^ (distance / attenuation_distance).
Rough surfaces blur the picture by size ^ (roughness min(2 ior - 2, 1)) pixels, as three.js does.

As in the sample viewer of Khronos, transmissive objects are not seen through one another, a picture
without a background is black behind them, and what lies outside the picture is its border.

Based on: Khronos Group, "KHR_materials_transmission" and "KHR_materials_volume", 2021; the
glTF sample viewer of Khronos, for the lookup in a picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.shading_models import head_on, normals_effect
from texbake.rendering.effects.slots import slot_values
from texbake.rendering.fragments import Fragments
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target
from texbake.texture.mipmaps import MipChain, mip_chain, single_level
from texbake.texture.sample import sample


@dataclass(frozen=True, eq=False)
class PictureBehind:
    """A picture without transmissive objects: as it is, and with mip levels."""

    sharp: MipChain
    blurred: MipChain | None  # None if no surface is rough

    @property
    def n_bytes(self) -> int:
        """Memory of its pixels."""
        return self.sharp.texels.nbytes + (self.blurred.texels.nbytes if self.blurred else 0)


def _transmits(request: RenderRequest, index: int) -> bool:
    material = request.material(index)
    return material.transmission is not None and material.shading == "metallic-roughness"


def _draw_behind(state: RenderState, target: Target) -> PictureBehind:
    objects = tuple(
        replace(item, visible=item.visible and item.material.transmission is None)
        for item in state.scene.objects
    )
    options = state.options
    if options.background is None:
        options = replace(options, background=(0.0, 0.0, 0.0))
    (view,) = state.draw_others(replace(state.scene, objects=objects), [state.camera], options)
    colors = np.ascontiguousarray(view[..., :3])
    rough = any(
        item.material.transmission is not None and item.material.roughness != 0.0
        for item in state.scene.objects
    )
    blurred = mip_chain(colors, kind="data", wrap="clamp", threads=state.threads) if rough else None
    return PictureBehind(single_level(colors), blurred)


def _needs(request: RenderRequest, target: int) -> Iterator[str]:
    transmission = request.material(target).transmission
    assert transmission is not None
    if transmission.thickness != 0.0:
        yield "positions"


def _transmit(fragments: Fragments, state: RenderState) -> None:
    """Take the transmitted share from what the surface scatters, and add what lies behind it."""
    material, values = fragments.drawn.material, fragments.values
    transmission = material.transmission
    assert transmission is not None and values.metalness is not None
    strength = slot_values(
        fragments, state, "transmission.strength", transmission.strength, channels=1
    )
    share = np.clip(strength, 0.0, 1.0) * (1.0 - values.metalness)
    facing = np.clip(pm.vecdot(fragments.normals, fragments.to_eye), 0.0, 1.0)[:, None]
    away = 1.0 - facing
    least = head_on(material.ior)
    mirrored = least + (1.0 - least) * (away * away) * (away * away) * away
    passed = (1.0 - mirrored) * share * values.base_color
    at, distance = _place_behind(fragments, state)
    if distance is not None and transmission.attenuation_distance is not None:
        color = np.maximum(transmission.attenuation_color, 1e-6)
        ways = distance / transmission.attenuation_distance
        passed = passed * pm.exp(pm.log(color) * ways)
    light = passed * _look_behind(fragments, state, at)
    fragments.light += light.astype(np.float32)
    base = values.base_color * (1.0 - share)
    fragments.slots = replace(values, base_color=np.ascontiguousarray(base, np.float32))


def _place_behind(fragments: Fragments, state: RenderState) -> tuple[FloatArray, FloatArray | None]:
    """(n, 2) places in the picture, v up, and (n, 1) distances in the volume, if it has one."""
    width, height = state.options.width, state.options.height
    size = np.array([width, height], np.float64)
    transmission = fragments.drawn.material.transmission
    assert transmission is not None
    straight = fragments.places / size
    straight[:, 1] = 1.0 - straight[:, 1]
    if transmission.thickness == 0.0:
        return straight, None
    thickness = slot_values(
        fragments, state, "transmission.thickness", transmission.thickness, channels=1
    )
    bent = np.empty_like(fragments.normals)
    core.refract_directions(
        fragments.normals, fragments.to_eye, np.zeros(len(fragments), np.bool_),
        max(float(fragments.drawn.material.ior), 1.0), bent,
    )  # fmt: skip
    distance = np.maximum(thickness, 0.0).astype(np.float64) * _scale(fragments)
    distance = np.broadcast_to(distance, (len(fragments), 1))
    ends = fragments.positions + bent * distance
    matrix = state.camera.clip_from_world(width / height)
    clip = pm.matmul(np.concatenate([ends, np.ones((len(ends), 1))], axis=1), matrix.T)
    ahead = clip[:, 3:] > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        found = 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]
    return np.where(ahead, found, straight), distance


def _scale(fragments: Fragments) -> float:
    """How many units of the world one of the object is, in the mean over its axes."""
    inverse = fragments.drawn.object_from_world
    if inverse is None:
        return 1.0
    volume = abs(float(pm.det(inverse[:3, :3])))
    return float(pm.power(1.0 / volume, 1.0 / 3.0)) if volume > 0.0 else 1.0


def _look_behind(fragments: Fragments, state: RenderState, at: FloatArray) -> Float32Array:
    """(n, 3) light of the picture behind at places (n, 2), blurred where the surface is rough."""
    picture = state.of(_draw_behind)
    material, roughness = fragments.drawn.material, fragments.values.roughness
    assert roughness is not None
    spread = np.broadcast_to(roughness[:, 0], len(fragments)) * np.clip(
        2.0 * material.ior - 2.0, 0.0, 1.0
    )
    if picture.blurred is None or not spread.any():
        return sample(picture.sharp, at, filter="bilinear", wrap="clamp", threads=1)
    width, height = state.options.width, state.options.height
    pixels = pm.exp(pm.log(float(max(width, height))) * spread)
    footprint = np.zeros((len(fragments), 4), np.float32)
    footprint[:, 0], footprint[:, 3] = pixels / width, pixels / height
    return sample(picture.blurred, at, footprint, filter="ewa", wrap="clamp", threads=1)


PICTURE_BEHIND = Effect(
    name="picture behind",
    does="draws the scene without transmissive objects",
    after="rendered environment",
    of="picture",
    left_out="no material in the picture transmits light",
    prepare=_draw_behind,
)

TRANSMISSION = Effect(
    name="transmission",
    does="shows what lies behind a surface",
    after="bump map",
    among="lit",
    material_field="transmission",
    strength="strength",
    when=_transmits,
    why="its material transmits light",
    left_out="no material in the picture transmits light",
    needs=("slots", normals_effect, "view directions", "picture behind", _needs),
    shade=_transmit,
    rate="pixel",
)
