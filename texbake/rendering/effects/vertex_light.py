"""Shading per vertex: light is found at the corners of triangles and interpolated between them.

Gouraud shading. Lamps, ambient light and light of the environment, with their shadows and slides,
are evaluated at the corners alone. So are normal maps and bump maps, which is why these show
nothing between the corners. Images of the base color, light maps, emission and mirrors are looked
up at pixels as always: at a corner the light that a white surface W and a black surface B reflect
is found, and a pixel of the base color C shows B + (W - B) C. That is exact for all models but
for a surface that is partly metal, whose light is not linear in C.

Based on: Gouraud, "Continuous shading of curved surfaces", IEEE Transactions on Computers 20(6),
1971.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.effect import Call, Effect, RenderState
from texbake.rendering.fragments import Floats, Fragments
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Result, Target

# Faces shaded together.
_BAND = 1 << 12
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
_WHITE = np.ones((1, 3), np.float32)


@dataclass(frozen=True, eq=False)
class CornerLight:
    """Light at the corners of drawn faces, (F, 3, 3) float32.

    `own` is that of a black surface, `reflected` what a white one adds to it.
    """

    own: Floats
    reflected: Floats

    @property
    def n_bytes(self) -> int:
        """Memory of both."""
        return self.own.nbytes + self.reflected.nbytes


def _called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.lit:
        if request.material(index).shading_rate == "vertex":
            yield Call(index, request.name(index), "its material is shaded per vertex")


def _shade_corners(state: RenderState, target: Target) -> CornerLight:
    assert target is not None
    n_faces = len(state.drawn(target).faces)
    own, reflected = (np.zeros((n_faces, 3, 3), np.float32) for _ in range(2))

    def work(start: int, stop: int) -> None:
        faces = np.repeat(np.arange(start, stop, dtype=np.int32), 3)
        black = _light(state, target, faces, np.zeros((1, 3), np.float32))
        white = _light(state, target, faces, _WHITE)
        own[start:stop] = black.reshape(-1, 3, 3)
        reflected[start:stop] = (white - black).reshape(-1, 3, 3)

    run_bands(work, n_faces, band=_BAND, threads=state.threads)
    return CornerLight(own, reflected)


def _light(state: RenderState, target: int, faces: IntArray, base: Floats) -> Floats:
    """(n, 3) float32: light that corners of faces reflect with a base color."""
    fragments = _at_corners(state, target, faces)
    for effect in state.plan.for_target(target):
        if effect.shade is None or effect.rate == "pixel":
            continue
        with state.costs.timed(effect.name):
            effect.shade(fragments, state)
        if effect.name == "view directions":
            fragments.to_eye = _toward_eye(fragments, state)
        if effect.name == "slots":
            fragments.slots = replace(fragments.values, base_color=base)
    return fragments.light


def _at_corners(state: RenderState, target: int, faces: IntArray) -> Fragments:
    """Make fragments at the corners of faces, each given three times."""
    drawn = state.drawn(target)
    n = len(faces)
    weights = np.tile(_CORNERS, (n // 3, 1))
    # A corner is not a pixel, so that textures are looked up at their finest level.
    wanted = state.plan.has("derivatives", target)
    changes = np.zeros((n if wanted else 0, 4), np.float32)
    base = (
        (faces, weights, changes)
        if drawn.base_faces is None
        else drawn.on_base(faces, weights, changes)
    )
    first, second, third = np.moveaxis(drawn.positions[drawn.faces[faces]], 1, 0)
    normals = np.cross(second - first, third - first)
    away = pm.vecdot(normals, state.camera.eye - first) < 0.0
    return Fragments(
        target=target,
        drawn=drawn,
        drawn_faces=faces,
        drawn_weights=weights,
        faces=base[0],
        weights=base[1],
        changes=base[2],
        places=np.zeros((n, 2), np.float32),
        pixels=np.zeros(n, np.int32),
        counts=np.ones(n, np.float32),
        back_facing=np.ascontiguousarray(away),
        light=np.zeros((n, 3), np.float32),
    )


def _toward_eye(fragments: Fragments, state: RenderState) -> Floats:
    assert fragments.positions is not None
    way = state.camera.eye - fragments.positions
    lengths = pm.norm(way, axis=1, keepdims=True)
    return np.ascontiguousarray(way / np.where(lengths > 0.0, lengths, 1.0), np.float32)


def _interpolate(fragments: Fragments, state: RenderState) -> None:
    corners = state.of(CORNER_LIGHT, fragments.target)
    second, third = fragments.drawn_weights.T
    weights = np.stack([1.0 - second - third, second, third], axis=1).astype(np.float32)
    own, reflected = (
        pm.vecmat(weights, values[fragments.drawn_faces])
        for values in (corners.own, corners.reflected)
    )
    fragments.light += own + reflected * fragments.values.base_color


CORNER_LIGHT = Result(_shade_corners)

VERTEX_LIGHT = Effect(
    name="vertex light",
    does="interpolates light between vertices",
    called_for=_called_for,
    left_out="no material in the picture is shaded per vertex",
    needs=lambda request, target: ("slots", "positions"),
    prepare=CORNER_LIGHT,
    shade=_interpolate,
    rate="pixel",
)
