"""Fog: light fades into the fog's color with the distance from the eye.

What is left of a surface's light after the distance d is (end - d) / (end - start) for `linear`
fog, exp(-density d) for `exp` and exp(-(density d)^2) for `exp2`. What lies infinitely far behind
all surfaces has faded altogether, so that a scene with fog shows no environment there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texbake.kernels import kernel
from texbake.rendering.effect import (
    Call,
    Effect,
    Refusal,
    RenderState,
    Target,
)
from texbake.rendering.fragments import Fragments
from texbake.rendering.request import RenderRequest
from texbake.texture.image import FloatImage

_MODES = {"linear": 0, "exp": 1, "exp2": 2}


def _called_for(request: RenderRequest) -> Iterator[Call | Refusal]:
    fog = request.scene.lighting.fog
    if fog is None:
        return
    if not fog.fades:
        yield Refusal("the scene", "its fog has no density")
    else:
        for index in request.shaded:
            yield Call(index, request.name(index), "the scene has fog")


def left_after(distance: float, mode: int, density: float, start: float, end: float) -> float:
    """Share of light that is left after a distance; `mode` is 0 linear, 1 exp, 2 exp2."""
    if mode == 0:
        return min(max((end - distance) / (end - start), 0.0), 1.0)
    thickness = density * distance
    return math.exp(-thickness if mode == 1 else -thickness * thickness)


_left_after = kernel(left_after)


@kernel
def _fog_kernel(positions, eye, mode, density, start, end, color, out):  # type: ignore[no-untyped-def]
    for i in range(len(out)):
        squared = 0.0
        for k in range(3):
            squared += (positions[i, k] - eye[k]) ** 2
        left = _left_after(math.sqrt(squared), mode, density, start, end)
        for k in range(3):
            out[i, k] = left * out[i, k] + (1.0 - left) * color[k]


def _shade(fragments: Fragments, state: RenderState) -> None:
    fog = state.scene.lighting.fog
    assert fog is not None
    _fog_kernel(
        fragments.positions, state.camera.eye, _MODES[fog.mode], float(fog.density),
        float(fog.start), float(fog.end), np.array(fog.color, np.float64), fragments.light,
    )  # fmt: skip


def _positions(request: RenderRequest, target: Target) -> tuple[str, ...]:
    return ("positions",)


def _hides(request: RenderRequest) -> Iterator[Call]:
    fog = request.scene.lighting.fog
    if fog is not None and fog.fades and not request.shows_buffer:
        yield Call(None, "the scene", "its fog hides what lies infinitely far")


def _color(state: RenderState) -> FloatImage:
    fog = state.scene.lighting.fog
    assert fog is not None
    return np.array(fog.color, np.float32)


FOG_BEHIND = Effect(
    name="fog behind",
    does="shows fog behind all surfaces",
    of="picture",
    called_for=_hides,
    left_out="the scene has no fog",
    behind=_color,
)

FOG = Effect(
    name="fog",
    does="fades light with distance",
    called_for=_called_for,
    left_out="the scene has no fog",
    needs=_positions,
    shade=_shade,
)
