"""Bump maps: a height d over the surface that tilts its normal, or only shades as though it did.

With P(u, v) the surface and N its unit normal, d moves it to P' = P + d N. Its normal there is that
of P'_u x P'_v with

    P'_u = P_u + d_u N + d N_u,    P'_v = P_v + d_v N + d N_v.

`exact` is that cross product. `blinn` leaves out d N_u and d N_v, small where the surface is bent
little over a height of d, which gives (P_u x P_v) + d_u (N x P_v) - d_v (N x P_u). On a plane both
are the same. N is the shading normal that was there before, of the mesh or of a normal map; a flat
d leaves it as it is. d_u and d_v are central differences
(`texbake.rendering.effects.bump_surface`).

`emboss` leaves the normal alone. To the diffuse light of every lamp it adds, per unit of light,
f(u + L_u, v + L_v) - f(u - L_u, v - L_v), where (L_u, L_v) is the way that the light takes along
the surface, as far as half a step of those differences. Divided by the length of that way it is the
slope of d along the light: what to first order the tilted normal would add to N·L. Sides turned
away from a lamp get nothing, and shine is not embossed.

Where a triangle has no area, in space or on the texture, nothing is tilted. Seen from behind, hills
are hollows.

Based on: Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978; Schlag, "Fast embossing effects
on raster image data", Graphics Gems IV, 1994.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import Call, Effect, RenderState, Result, Target
from texbake.rendering.effects.bump_surface import (
    bump_of,
    bump_surface,
    dot,
    frame_at,
    heights_at,
    is_over_uvs,
    kernel_arrays,
    lookup_steps,
    turned,
)
from texbake.rendering.effects.lights import incident, shining
from texbake.rendering.effects.normals import finish_normal
from texbake.rendering.effects.shading_models import normals_effect
from texbake.rendering.fragments import Fragments, row_dot, row_of
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.textures import ImageTexture


def _bump_called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.shaded if "normals" in request.keep else request.lit:
        holder = request.material(index).bump_map
        if holder is not None and holder.form != "emboss":
            yield Call(index, request.name(index), f"its material has a bump map, {holder.form}")


def _emboss_called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.lit:
        holder = request.material(index).bump_map
        if holder is not None and holder.form == "emboss" and shining(request):
            yield Call(index, request.name(index), "its material has a bump map, emboss")


def _needs(request: RenderRequest, target: Target) -> Iterator[str]:
    assert target is not None
    holder = bump_of(request, target)
    yield "derivatives"
    yield "images" if isinstance(holder.texture, ImageTexture) else "procedures"
    if is_over_uvs(holder):
        yield "texture coordinates"
    yield from ("vertex normals", normals_effect(request, target))


def _emboss_needs(request: RenderRequest, target: Target) -> Iterator[str]:
    yield from _needs(request, target)
    yield "slots"
    if any(request.light(index).kind != "directional" for index in shining(request)):
        yield "positions"


@kernel
def _bump_kernel(surface, fragments, to_world, heights, slopes, back, out):  # type: ignore[no-untyped-def]
    frame, bumped = np.empty((5, 3)), np.empty(3)
    shading, sides = fragments[2], fragments[3]
    for i in range(len(slopes)):
        area = frame_at(i, surface, fragments, frame)
        if area == 0.0 or not math.isfinite(area):
            for k in range(3):
                out[i, k] = shading[i, k]
            continue
        for k in range(3):
            frame[1, k] += slopes[i, 0] * frame[0, k] + heights[i] * frame[3, k]
            frame[2, k] += slopes[i, 1] * frame[0, k] + heights[i] * frame[4, k]
        u, v = frame[1], frame[2]
        turned(
            to_world,
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
            bumped,
        )
        side = -1.0 if sides[i] != (area < 0.0) else 1.0
        finish_normal(bumped[0], bumped[1], bumped[2], side, back, out[i])


def _bump(fragments: Fragments, state: RenderState) -> None:
    surface = state.of(BUMP_SURFACES, fragments.target)
    steps = lookup_steps(fragments, state, surface)
    slopes = np.empty_like(steps)
    for axis in range(2):
        shifts = np.zeros_like(steps)
        shifts[:, axis] = 0.5 * steps[:, axis]
        rise = heights_at(fragments, state, surface, shifts)
        rise -= heights_at(fragments, state, surface, -shifts)
        slopes[:, axis] = _over(rise, steps[:, axis])
    heights = np.zeros(len(fragments))
    if bump_of(state.request, fragments.target).form == "exact":
        heights = heights_at(fragments, state, surface, np.zeros((1, 2)))
    normals = np.empty((len(fragments), 3), np.float32)
    _bump_kernel(
        *kernel_arrays(fragments, surface), surface.to_world, heights, slopes,
        state.camera.axes[2], normals,
    )  # fmt: skip
    fragments.normals = normals


def _over(rises: FloatArray, steps: FloatArray) -> FloatArray:
    """Rises over steps; no slope where there is no step."""
    return np.divide(rises, steps, out=np.zeros_like(rises), where=steps > 0.0)


@kernel
def _light_steps_kernel(surface, fragments, directions, to_object, steps, shifts, lengths):  # type: ignore[no-untyped-def]
    """Write the step (L_u, L_v) that the light takes, and how long it is for light along it."""
    frame, light = np.empty((5, 3)), np.empty(3)
    for i in range(len(steps)):
        shifts[i, 0], shifts[i, 1], lengths[i] = 0.0, 0.0, 0.0
        area = frame_at(i, surface, fragments, frame)
        d = row_of(directions, i)
        size = turned(to_object, directions[d, 0], directions[d, 1], directions[d, 2], light)
        u, v = frame[1], frame[2]
        uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
        if area == 0.0 or not size > 0.0:
            continue
        along, up = dot(light, u) / size, dot(light, v) / size
        x = -(along * vv - up * uv) / (uu * vv - uv * uv)
        y = -(up * uu - along * uv) / (uu * vv - uv * uv)
        longest = max(abs(x) / steps[i, 0], abs(y) / steps[i, 1])
        if 0.0 < longest < np.inf:
            lengths[i] = 0.5 / longest
            shifts[i, 0], shifts[i, 1] = x * lengths[i], y * lengths[i]


@kernel
def _emboss_kernel(normals, directions, radiance, base, metalness, lifts, out):  # type: ignore[no-untyped-def]
    for i in range(len(normals)):
        d, r, b = row_of(directions, i), row_of(radiance, i), row_of(base, i)
        facing = row_dot(normals, i, directions, d)
        if facing > 0.0:
            added = max(lifts[i], -facing) * (1.0 - metalness[row_of(metalness, i), 0])
            for k in range(3):
                out[i, k] += radiance[r, k] * base[b, k] * added


_NO_METAL = np.zeros((1, 1), np.float32)


def _emboss(fragments: Fragments, state: RenderState) -> None:
    surface = state.of(EMBOSSED_SURFACES, fragments.target)
    steps = lookup_steps(fragments, state, surface)
    shifts, lengths = np.empty_like(steps), np.empty(len(fragments))
    is_metal = fragments.drawn.material.shading == "metallic-roughness"
    for index in shining(state.request):
        light = incident(fragments, state, index)
        _light_steps_kernel(
            *kernel_arrays(fragments, surface), light.directions, surface.directions_to_object,
            steps, shifts, lengths,
        )  # fmt: skip
        rise = heights_at(fragments, state, surface, shifts)
        rise -= heights_at(fragments, state, surface, -shifts)
        _emboss_kernel(
            fragments.normals, light.directions, light.radiance, fragments.values.base_color,
            fragments.values.metalness if is_metal else _NO_METAL, _over(rise, 2.0 * lengths),
            fragments.light,
        )  # fmt: skip


BUMP_SURFACES = Result(bump_surface)
EMBOSSED_SURFACES = Result(bump_surface)

BUMP_MAP = Effect(
    name="bump map",
    does="tilts normals by the slope of a height",
    called_for=_bump_called_for,
    left_out="no lit material in the picture has a bump map",
    needs=_needs,
    load=BUMP_SURFACES,
    shade=_bump,
)

EMBOSS = Effect(
    name="emboss",
    does="adds the slope of a height along the light to diffuse light",
    called_for=_emboss_called_for,
    left_out="no lit material in the picture is embossed",
    needs=_emboss_needs,
    load=EMBOSSED_SURFACES,
    shade=_emboss,
)
