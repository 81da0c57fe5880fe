"""Bump maps: a height d over the surface that tilts its normal, or embosses its shading.

With P(u, v) the surface and N its unit normal, the bumped surface is P' = P + d N. Its normal is
the direction of P'_u x P'_v, with

    P'_u = P_u + d_u N + d N_u,    P'_v = P_v + d_v N + d N_v.

`exact` is that cross product. `blinn` drops d N_u and d N_v, which are small where d is small
compared to the radius of curvature; this gives (P_u x P_v) + d_u (N x P_v) - d_v (N x P_u). On a
plane both forms agree. N is the shading normal of the mesh or of a normal map; a constant d leaves
it unchanged.

d_u and d_v are differences of the height: central, d(u + h/2) - d(u - h/2), with an error of the
order of h^2, or one-sided, `forward` or `backward`, with an error of the order of h, which shifts
the relief by half a step. The step h is one texel or one pixel, whichever is larger. A procedure in
space has lengths along the triangle for u and v, and steps of one pixel, or of 1/1024 of an edge at
the corners of triangles that are shaded per vertex.

`emboss` leaves the normal unchanged. For each lamp it adds to the diffuse light, per unit of light,
f(u - L_u, v - L_v) - f(u + L_u, v + L_v), where (L_u, L_v) is the direction to the light along the
surface, scaled to half a step. This is the height away from the light minus the height toward it:
a slope that falls toward the light faces it. Divided by the step, it is what the tilted normal
would add to N·L, to first order. On a slope of 0.25 it is up to 0.03 too bright.
`emboss-normalized` divides by the length of the bent normal N' = N - grad d:

    (N·L + f(u - L_u, v - L_v) - f(u + L_u, v + L_v)) / sqrt(N'·N'),

which is N'·L of Blinn's form. With `light_space` object, L is brought to the object's space and
compared with the normal there, which saves turning normals to world space. That is the same unless
the object is scaled by different factors along its axes. Sides turned away from a lamp get nothing,
and specular highlights are not embossed.

Based on: Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978; Schlag, "Fast embossing effects
on raster image data", Graphics Gems IV, 1994; Mikkelsen, "Bump mapping unparametrized surfaces on
the GPU", 2010, for slopes without texture coordinates.

Kernel: `core/bump_maps.c`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.compose import transformed_normals
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.records import dataclass
from texbake.rendering.effect import Effect, Rejection, RenderState
from texbake.rendering.effects.images import image_of, look_up
from texbake.rendering.effects.lights import incident
from texbake.rendering.effects.normals import mesh_normals, same_from_all_sides
from texbake.rendering.effects.points import (
    coordinates_effect,
    steps_along_surface,
    steps_along_texture,
    textured_mesh,
)
from texbake.rendering.effects.shading_models import lamp_positions, normals_effect
from texbake.rendering.effects.slots import procedure_values
from texbake.rendering.fragments import Fragments
from texbake.rendering.rasterize import read_only
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import EMBOSS_FORMS, BumpMap, Material
from texbake.rendering.scene.textures import ImageTexture

_NAME = "bump_map.texture"
# Step at a corner, as a share of the triangle's first edge.
_OF_EDGE = 2.0**-10


@dataclass(frozen=True, kw_only=True, eq=False)
class BumpSurface:
    """A surface in its object's space, indexed by the face corners of the placed mesh."""

    # positions (V, 3), faces (F, 3)
    positions: FloatArray
    faces: IntArray
    # normals (N, 3), normal_faces (F, 3)
    normals: FloatArray
    normal_faces: IntArray
    steps: FloatArray  # (F, 4): growth of the barycentric weights per unit of u, then of v
    # to_object, to_world (3, 3): transform normals to object space and back, up to their length
    to_object: FloatArray
    to_world: FloatArray
    directions_to_object: FloatArray  # (3, 3): transforms directions to object space

    @property
    def n_bytes(self) -> int:
        """Memory in bytes, without arrays shared with the mesh."""
        return self.steps.nbytes


def bump_of(request: RenderRequest, target: int) -> BumpMap:
    """Return the bump map of an object that has one."""
    holder = request.material(target).bump_map
    assert holder is not None
    return holder


def bump_surface(state: RenderState, target: int) -> BumpSurface:
    """Prepare the surface of an object with a bump map; it does not depend on the camera."""
    item = state.scene.objects[target]
    mesh = textured_mesh(state, target)
    linear = np.eye(3) if item.transform is None else item.transform[:3, :3]
    inverse: FloatArray = np.asarray(pm.inv(linear), np.float64)
    normals, corners = state.of(mesh_normals, target)
    if item.transform is not None:
        normals = transformed_normals(normals, inverse)
        lengths = pm.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    points = item.mesh.positions
    texture = bump_of(state.request, target).texture
    steps = (
        steps_along_texture(mesh.corner_uvs(texture.uv_set))
        if texture.is_over_uvs
        else steps_along_surface(points[mesh.faces])
    )
    return BumpSurface(
        positions=read_only(points, np.float64),
        faces=read_only(mesh.faces, np.int32),
        normals=read_only(normals, np.float64),
        normal_faces=read_only(corners, np.int32),
        steps=read_only(steps, np.float64),
        to_object=np.ascontiguousarray(linear.T),
        to_world=np.ascontiguousarray(inverse.T),
        directions_to_object=inverse,
    )


def lookup_steps(fragments: Fragments, state: RenderState, surface: BumpSurface) -> FloatArray:
    """(n, 2) float64: step of the central differences of d along u and v."""
    holder = bump_of(state.request, fragments.target)
    if not holder.texture.is_over_uvs:
        steps = np.empty((len(fragments), 2))
        core.measure_pixel_steps(
            surface.positions, surface.faces, fragments.faces, fragments.changes, steps
        )
        # A corner has no pixel width, so its step is a small share of an edge.
        first, second = surface.positions[surface.faces[fragments.faces, :2].T]
        edges = _OF_EDGE * np.sqrt(((second - first) ** 2).sum(axis=1))
        return np.where(steps > 0.0, steps, edges[:, None])
    _, changes = fragments.coordinates[holder.texture.uv_set]
    pixels = np.abs(changes.reshape(-1, 2, 2)).max(axis=1).astype(np.float64)
    if not isinstance(holder.texture, ImageTexture):
        return np.asarray(pixels)
    image = image_of(state, fragments.target, _NAME)
    turn = np.eye(2) if image.turn is None else image.turn
    # Texels per unit of u and of v.
    scales = pm.norm(turn * [[image.chain.width], [image.chain.height]], axis=0)
    texels = np.divide(1.0, scales, out=np.zeros(2), where=scales > 0.0)
    return np.asarray(np.maximum(pixels, texels))


def heights_at(
    fragments: Fragments, state: RenderState, surface: BumpSurface, shifts: FloatArray
) -> FloatArray:
    """(n,) float64: d at fragments shifted by (n or 1, 2) in (u, v), in units of the object."""
    holder = bump_of(state.request, fragments.target)
    texture = holder.texture
    if texture.is_over_uvs:
        uvs, changes = fragments.coordinates[texture.uv_set]
        moved = replace(fragments, coordinates={texture.uv_set: (uvs + shifts, changes)})
    else:
        along = pm.vecmat(shifts, surface.steps[fragments.faces].reshape(-1, 2, 2))
        moved = replace(fragments, weights=fragments.weights + along)
    values = (
        look_up(moved, state, _NAME)
        if isinstance(texture, ImageTexture)
        else procedure_values(moved, texture, 1)
    )
    return np.asarray(values[:, 0] * np.float64(holder.height))


def kernel_arrays(fragments: Fragments, surface: BumpSurface) -> tuple[Any, ...]:
    """Return the arrays that kernels take for a surface and for the fragments on it."""
    return (
        surface.positions, surface.faces, surface.normals, surface.normal_faces, surface.steps,
        surface.to_object,
        fragments.faces, fragments.weights, fragments.normals, fragments.back_facing,
    )  # fmt: skip


def _bump_reasons(request: RenderRequest, index: int) -> Iterator[str | Rejection]:
    holder = request.material(index).bump_map
    if holder is not None and holder.form not in EMBOSS_FORMS:
        against = same_from_all_sides(request, index)
        yield Rejection(against) if against else f"its material has a bump map, {holder.form}"


def _emboss_reasons(request: RenderRequest, index: int) -> Iterator[str]:
    holder = request.material(index).bump_map
    if holder is not None and holder.form in EMBOSS_FORMS and request.shining:
        yield f"its material has a bump map, {holder.form}"


def _texture_needs(request: RenderRequest, target: int) -> Iterator[str]:
    texture = bump_of(request, target).texture
    yield texture.effect
    if texture.is_over_uvs:
        yield coordinates_effect(texture.uv_set)


def _without_bumps(material: Material, *, embossed: bool) -> Material:
    bumps = material.bump_map
    if bumps is None or (bumps.form in EMBOSS_FORMS) != embossed:
        return material
    return replace(material, bump_map=None)


def _bump(fragments: Fragments, state: RenderState) -> None:
    surface = state.of(bump_surface, fragments.target)
    slopes = _slopes(fragments, state, surface, lookup_steps(fragments, state, surface))
    heights = np.zeros(len(fragments))
    if bump_of(state.request, fragments.target).form == "exact":
        heights = heights_at(fragments, state, surface, np.zeros((1, 2)))
    normals = np.empty((len(fragments), 3), np.float32)
    core.tilt_normals(
        *kernel_arrays(fragments, surface), surface.to_world, heights, slopes,
        state.camera.axes[2], normals,
    )  # fmt: skip
    fragments.normals = normals


# Where the heights lie that a difference compares, in steps from the point.
_ENDS = {"central": (-0.5, 0.5), "forward": (0.0, 1.0), "backward": (-1.0, 0.0)}


def _slopes(
    fragments: Fragments, state: RenderState, surface: BumpSurface, steps: FloatArray
) -> FloatArray:
    """(n, 2) float64: d_u and d_v at fragments, from differences over steps."""
    slopes = np.empty_like(steps)
    low, high = _ENDS[bump_of(state.request, fragments.target).difference]
    for axis in range(2):
        shifts = np.zeros_like(steps)
        shifts[:, axis] = steps[:, axis]
        rise = heights_at(fragments, state, surface, high * shifts)
        rise -= heights_at(fragments, state, surface, low * shifts)
        slopes[:, axis] = _divide(rise, steps[:, axis])
    return slopes


def _divide(rises: FloatArray, steps: FloatArray) -> FloatArray:
    """Rises divided by steps; 0 where the step is 0."""
    return np.divide(rises, steps, out=np.zeros_like(rises), where=steps > 0.0)


_NO_METAL = np.zeros((1, 1), np.float32)


def _emboss(fragments: Fragments, state: RenderState) -> None:
    surface = state.of(bump_surface, fragments.target)
    steps = lookup_steps(fragments, state, surface)
    shifts, lengths = np.empty_like(steps), np.empty(len(fragments))
    holder = bump_of(state.request, fragments.target)
    normalized, in_object = holder.form == "emboss-normalized", holder.light_space == "object"
    slopes = _slopes(fragments, state, surface, steps) if normalized else np.zeros_like(steps)
    is_metal = fragments.drawn.material.shading == "metallic-roughness"
    for index in state.request.shining:
        light = incident(fragments, state, index)
        core.find_light_steps(
            *kernel_arrays(fragments, surface), light.directions, surface.directions_to_object,
            steps, shifts, lengths,
        )  # fmt: skip
        rise = heights_at(fragments, state, surface, shifts)
        rise -= heights_at(fragments, state, surface, -shifts)
        lifts = _divide(rise, 2.0 * lengths)
        core.bend_embossed(
            *kernel_arrays(fragments, surface), light.directions, surface.directions_to_object,
            surface.to_world, slopes, in_object, normalized, lifts,
        )  # fmt: skip
        core.add_embossed(
            fragments.normals, light.directions, light.radiance, fragments.values.base_color,
            fragments.values.metalness if is_metal else _NO_METAL, lifts, fragments.light,
        )  # fmt: skip


_NEEDS = ("derivatives", _texture_needs, "vertex normals", normals_effect)
BUMP_MAP = Effect(
    name="bump map",
    does="tilts normals by the slope of a height",
    after="normal map",
    among="with_normals",
    material_field="bump_map",
    strength="height",
    reasons=_bump_reasons,
    left_out="no lit material in the picture has a bump map",
    needs=_NEEDS,
    without=lambda scene: scene.with_materials(partial(_without_bumps, embossed=False)),
    load=bump_surface,
    shade=_bump,
    rate="vertex",
    gives_normals=True,
)

EMBOSS = Effect(
    name="emboss",
    does="adds the slope of a height along the light to diffuse light",
    after="metallic-roughness",
    among="lit",
    reasons=_emboss_reasons,
    left_out="no lit material in the picture is embossed",
    needs=(*_NEEDS, "slots", lamp_positions),
    without=lambda scene: scene.with_materials(partial(_without_bumps, embossed=True)),
    load=bump_surface,
    shade=_emboss,
    rate="vertex",
)
