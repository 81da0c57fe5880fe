"""The values of a material's slots at each fragment: constants, images and procedures.

A constant is a single row for all fragments. A procedure is evaluated at the fragment's position in
object space, world space or texture coordinates; a color ramp, if any, maps its value to a color.

Kernel: `core/interpolation.c`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import COLOR_SLOTS, look_up, without_textures
from texbake.rendering.effects.points import coordinates_effect
from texbake.rendering.fragments import Fragments, SlotValues, one_row, three_weights
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture, Slot, VolumeTexture
from texbake.texture.lookup import ramp_lookup, volume_lookup
from texbake.texture.procedures import evaluate

# Slots that are clipped to the range from 0 to 1.
_SHARES = ("roughness", "metalness")


def _reasons(request: RenderRequest, index: int) -> Iterator[str]:
    yield f"its shading is {request.material(index).shading}"


def _needs(request: RenderRequest, target: int) -> Iterator[str]:
    for _, texture in request.textures(target):
        yield texture.effect


def _look_up_all(fragments: Fragments, state: RenderState) -> None:
    material = fragments.drawn.material
    found: dict[str, Float32Array] = {}
    for name in state.request.slots(fragments.target):
        channels = 3 if name in COLOR_SLOTS else 1
        found[name] = slot_values(fragments, state, name, getattr(material, name), channels)
        if name in _SHARES:
            found[name] = np.clip(found[name], 0.0, 1.0)
    if material.vertex_colors and fragments.drawn.mesh.colors is not None:
        colored = found["base_color"] * vertex_colors(fragments)[:, :3]
        found["base_color"] = np.ascontiguousarray(colored, np.float32)
    fragments.slots = SlotValues(**found)


def slot_values(
    fragments: Fragments, state: RenderState, name: str, slot: Slot, channels: int
) -> Float32Array:
    """(n or 1, channels) float32: value of a slot at each fragment."""
    if isinstance(slot, ImageTexture):
        return look_up(fragments, state, name)
    if isinstance(slot, ProcedureTexture):
        return procedure_values(fragments, slot, channels)
    return one_row(slot, channels)


def procedure_values(
    fragments: Fragments, texture: ProcedureTexture, channels: int
) -> Float32Array:
    """(n, channels) float32: value of a procedure at each fragment."""
    points, footprint = _points(fragments, texture)
    if isinstance(texture, VolumeTexture):
        values = _volume_values(texture, points)
    else:
        values = evaluate(
            texture.procedure, points, footprint, parameters=texture.parameters,
            scalar=texture.colors is not None or channels == 1, threads=1,
        )  # fmt: skip
    if texture.colors is not None:
        values = ramp_lookup(np.asarray(texture.colors, np.float32), values[:, 0], threads=1)
    values = values * np.asarray(texture.factor, np.float32)
    if values.shape[1] == channels:
        return np.ascontiguousarray(values, np.float32)
    shown = values[:, :1] if channels == 1 else np.repeat(values[:, :1], channels, axis=1)
    return np.ascontiguousarray(shown, np.float32)


def _volume_values(texture: VolumeTexture, points: FloatArray) -> Float32Array:
    values = volume_lookup(
        texture.texels, points + texture.offset, wrap=texture.wrap, filter=texture.filter,
        border=texture.border, threads=1,
    )  # fmt: skip
    if texture.colors is None:
        return values
    low, high = texture.range
    return ((values - low) / (high - low)).astype(np.float32)


def _points(
    fragments: Fragments, texture: ProcedureTexture
) -> tuple[FloatArray, Float32Array | None]:
    """Points for a procedure, (n, 2) on the texture or (n, 3) in space, and the pixel widths."""
    scale = np.broadcast_to(np.asarray(texture.scale, np.float64), 3)
    wanted = texture.filtered and len(fragments.changes) > 0
    if texture.space == "uv":
        uvs, changes = fragments.coordinates[texture.uv_set]
        points = uvs * scale[:2]
        if not wanted:
            return points, None
        steps = np.abs(changes.reshape(-1, 2, 2)) * np.abs(scale[:2])
        return points, np.ascontiguousarray(steps.max(axis=1), np.float32)
    mesh, inverse = fragments.drawn.mesh, fragments.drawn.object_from_world
    matrix = np.eye(4) if texture.space == "world" or inverse is None else inverse
    points = np.empty((len(fragments), 3))
    widths = np.empty((len(fragments) if wanted else 0, 3), np.float32)
    core.find_scaled_points(
        mesh.positions, mesh.faces, np.ascontiguousarray(scale[:, None] * matrix[:3]),
        fragments.faces, fragments.weights, fragments.changes, points, widths,
    )  # fmt: skip
    return points, widths if wanted else None


def vertex_colors(fragments: Fragments) -> Float32Array:
    """(n, 3 or 4) float32: interpolated vertex colors."""
    mesh = fragments.drawn.mesh
    assert mesh.colors is not None
    corners = mesh.colors[mesh.faces[fragments.faces]]
    return np.asarray(pm.vecmat(three_weights(fragments.weights), corners), np.float32)


def _procedure_reasons(request: RenderRequest, index: int) -> Iterator[str]:
    for name, texture in request.textures_of(index, ProcedureTexture):
        yield f"{name} is {texture.procedure}"


def _procedures_need(request: RenderRequest, target: int) -> Iterator[str]:
    for _, texture in request.textures_of(target, ProcedureTexture):
        if texture.space == "uv":
            yield coordinates_effect(texture.uv_set)
        if request.wants_footprint(texture):
            yield "derivatives"


PROCEDURES = Effect(
    name="procedures",
    does="computes procedural textures",
    after="mip maps",
    reasons=_procedure_reasons,
    left_out="no material in the picture has a procedure",
    needs=(_procedures_need,),
    without=partial(without_textures, ProcedureTexture),
)

SLOTS = Effect(
    name="slots",
    does="looks up the slots of materials",
    after="parallax",
    reasons=_reasons,
    left_out="nothing is shaded",
    needs=(_needs,),
    shade=_look_up_all,
)
