"""Pictures thrown onto surfaces by slide projectors.

Each takes the place of the base color by its own opacity times its strength, one after another;
behind the projector and outside the unit square of its picture there is nothing of it. What hides a
surface from the projector does not: it colors everything that it reaches through.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import Call, Effect, RenderState, Result, Target
from texbake.rendering.effects.images import LoadedImage
from texbake.rendering.effects.projection import load_slide, pixel_steps, thrown
from texbake.rendering.fragments import Fragments
from texbake.rendering.maps import colors_and_opacity_from
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import ProjectedTexture
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT


@dataclass(frozen=True, eq=False)
class _Thrown:
    """A picture as it is looked up: four channels, colors times opacity and opacity."""

    image: LoadedImage
    matrix: FloatArray
    strength: float

    @property
    def n_bytes(self) -> int:
        return self.image.n_bytes


def _called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.shaded:
        if request.material(index).projected:
            yield Call(index, request.name(index), "a picture is thrown onto it")


def _load(state: RenderState, target: Target) -> list[_Thrown]:
    assert target is not None
    material = state.request.material(target)
    return [_loaded(state, item, i) for i, item in enumerate(material.projected)]


def _loaded(state: RenderState, item: ProjectedTexture, place: int) -> _Thrown:
    texture = item.texture
    colors, opacity = colors_and_opacity_from(texture.image, color=texture.color is not False)
    if opacity is None:
        opacity = np.ones_like(colors[..., :1])
    factor = np.broadcast_to(np.asarray(texture.factor, np.float32), 3)
    # Times the opacity before they are filtered, or what is clear would color what is not.
    texels = np.concatenate([colors * factor * opacity, opacity], axis=2)
    image = load_slide(
        replace(texture, factor=1.0, border=(0.0,)),
        texels,
        filter_name=state.request.filter_of(texture),
        name=f"projected[{place}].texture",
        threads=state.threads,
    )
    return _Thrown(image, np.asarray(item.matrix, np.float64), item.strength)


def _shade(fragments: Fragments, state: RenderState) -> None:
    base = fragments.values.base_color
    pictures = state.of(THROWN_PICTURES, fragments.target)
    steps = None
    if any(item.image.filter in FILTERS_WITH_FOOTPRINT for item in pictures):
        steps = pixel_steps(fragments, state)
    assert fragments.positions is not None
    for item in pictures:
        values, coverage = thrown(item.image, item.matrix, fragments.positions, steps)
        share = (item.strength * coverage)[:, None]
        base = base * (1.0 - share * values[:, 3:]) + share * values[:, :3]
    fragments.slots = replace(fragments.values, base_color=np.ascontiguousarray(base, np.float32))


THROWN_PICTURES = Result(_load)

PROJECTED_TEXTURES = Effect(
    name="projected textures",
    does="throws pictures onto surfaces",
    called_for=_called_for,
    left_out="no picture is thrown onto what is in the picture",
    needs=lambda request, target: ("slots", "positions"),
    load=THROWN_PICTURES,
    shade=_shade,
)
