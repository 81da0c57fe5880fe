"""Light that comes from everywhere, from the surface itself, or from a light map.

Three effects. Ambient light is the base color times the light from above and below, weighted by how
far the normal points up; times the base color for metals too, which stand for what they reflect.
Emission adds its slot. A light map adds its slot times the color that a surface scatters.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.effect import Call, Effect, RenderState, Target
from texbake.rendering.effects.shading_models import normals_effect
from texbake.rendering.fragments import (
    Floats,
    Fragments,
    one_row,
    row_of,
)
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Ambient


def _called_for(request: RenderRequest) -> Iterator[Call]:
    ambient = request.scene.lighting.ambient
    if any(ambient.color) or any(ambient.ground or ()):
        for index in request.lit:
            yield Call(index, request.name(index), "the scene has ambient light")


def _needs(request: RenderRequest, target: Target) -> Iterator[str]:
    assert target is not None
    yield "slots"
    if request.scene.lighting.ambient.ground is not None:
        yield normals_effect(request, target)


@kernel
def _ambient_kernel(normals, up, sky, ground, base, share, out):  # type: ignore[no-untyped-def]
    for i in range(len(out)):
        b, s = row_of(base, i), row_of(share, i)
        above = 1.0
        if len(normals) > 0:
            above = 0.5 + 0.5 * (
                normals[i, 0] * up[0] + normals[i, 1] * up[1] + normals[i, 2] * up[2]
            )
        for k in range(3):
            light = above * sky[0, k] + (1.0 - above) * ground[0, k]
            out[i, k] += share[s] * light * base[b, k]


def arriving_share(fragments: Fragments) -> Floats:
    """(n or 1,) float32: share of ambient light that neither the scene nor a map holds back."""
    occlusion = fragments.values.occlusion
    if occlusion is None:
        return fragments.ambient_share
    strength = np.float32(fragments.drawn.material.occlusion_strength)
    kept = np.float32(1.0) + strength * (occlusion[:, 0] - np.float32(1.0))
    return np.ascontiguousarray(fragments.ambient_share * kept, np.float32)


def add_ambient(
    ambient: Ambient, up: str, normals: Floats | None, base: Floats, share: Floats, light: Floats
) -> None:
    """Add ambient light, as a surface scatters it, to the light that leaves points.

    Parameters
    ----------
    ambient
        Light from above and below.
    up
        Axis of the world that is up: `y` or `z`.
    normals : (n, 3) float32
        Unit vectors; None is enough where both lights are the same.
    base : (n or 1, 3) float32
        Base color.
    share : (n or 1,) float32
        How much of it arrives.
    light : (n, 3) float32
        Added to in place.
    """
    two_sided = ambient.ground is not None and normals is not None
    _ambient_kernel(
        normals if two_sided else np.empty((0, 3), np.float32),
        np.array([0.0, 1.0, 0.0] if up == "y" else [0.0, 0.0, 1.0]),
        one_row(ambient.color, 3),
        one_row(ambient.color if ambient.ground is None else ambient.ground, 3),
        base,
        share,
        light,
    )


def _shade(fragments: Fragments, state: RenderState) -> None:
    add_ambient(
        state.scene.lighting.ambient,
        state.options.up,
        fragments.normals,
        fragments.values.base_color,
        arriving_share(fragments),
        fragments.light,
    )


def _emission_called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.shaded:
        if request.material(index).emission is not None:
            yield Call(index, request.name(index), "its material gives off light")


def _emit(fragments: Fragments, state: RenderState) -> None:
    assert fragments.values.emission is not None
    fragments.light += fragments.values.emission


def _light_map_called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.lit:
        if request.material(index).light_map is not None:
            yield Call(index, request.name(index), "its material has a light map")


def _add_light_map(fragments: Fragments, state: RenderState) -> None:
    scattered = fragments.values.base_color
    if fragments.values.metalness is not None:
        scattered = scattered * (1.0 - fragments.values.metalness)
    assert fragments.values.light_map is not None
    fragments.light += fragments.values.light_map * scattered


AMBIENT = Effect(
    name="ambient",
    does="adds light from everywhere",
    called_for=_called_for,
    left_out="the scene has no ambient light, or nothing that it falls on",
    needs=_needs,
    shade=_shade,
)

LIGHT_MAP = Effect(
    name="light map",
    does="adds baked light",
    called_for=_light_map_called_for,
    left_out="no lit material in the picture has a light map",
    needs=lambda request, target: ("slots",),
    shade=_add_light_map,
)

EMISSION = Effect(
    name="emission",
    does="adds light of the surface itself",
    called_for=_emission_called_for,
    left_out="no material in the picture gives off light",
    needs=lambda request, target: ("slots",),
    shade=_emit,
)
