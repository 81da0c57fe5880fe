"""Fog: light fades into the fog's color with the distance from the camera.

At the distance d the share (end - d) / (end - start) of a surface's light remains for `linear` fog,
exp(-density d) for `exp`, and exp(-(density d)^2) for `exp2`. The background is infinitely far
away and has faded completely, so a scene with fog does not show its environment there.

Kernel: `core/surrounding_light.c`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.core import core
from texbake.rendering.effect import Call, Effect, Refusal, RenderState
from texbake.rendering.fragments import Fragments
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target
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


def _shade(fragments: Fragments, state: RenderState) -> None:
    fog = state.scene.lighting.fog
    assert fog is not None
    core.fade_into_fog(
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
    rate="pixel",
)
