"""Shadow maps: what lights see first, and with it what they do not reach.

A map is rasterized for each light that asks for shadows, unless none of them can fall on anything
seen. It keeps, for each texel, the depth and the triangle that the light sees at its center; in
which view, `texbake.rendering.effects.shadow_fit` says. The light of a point is dimmed by the
share of
its surroundings in the map that lies in shadow (`texbake.rendering.effects.shadow_filter`).

What is opaque in part casts the shadow of what is opaque.

Based on: Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.rendering.effect import (
    Call,
    Effect,
    Refusal,
    RenderState,
    Result,
    Target,
)
from texbake.rendering.effects.lights import PLACED_LIGHTS, placed_light, shining
from texbake.rendering.effects.shadow_filter import ShadowMap, lit_radiance
from texbake.rendering.effects.shadow_fit import (
    Box,
    Pair,
    box_of,
    corners_of,
    parallel_view,
    perspective_views,
    seen_bounds,
    shading_pairs,
)
from texbake.rendering.fragments import Fragments, Incident
from texbake.rendering.raster.rasterize import rasterize
from texbake.rendering.raster.world import SHOW_BACK, SKIP
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Light


def _pairs(
    request: RenderRequest, index: int, state: RenderState | None = None
) -> list[Pair] | str:
    """Pairs of what may cast and what may receive shadows of a light, or why there are none.

    With a picture it is known which objects are seen, and how far displaced ones reach.
    """
    objects = request.scene.objects
    casters = [i for i, item in enumerate(objects) if item.casts_shadows]
    receivers = [i for i in request.lit if objects[i].receives_shadows]
    if state is not None:
        receivers = [i for i in receivers if i in state.visible.objects]
    if index not in shining(request):
        return "it is dark"
    if not receivers:
        return "nothing that receives shadows is in the picture"
    if not casters:
        return "no object casts shadows"

    def box(i: int) -> Box | None:
        if state is not None:
            return box_of(state, i)
        return None if request.material(i).displacement is not None else corners_of(objects[i])

    boxes = {i: box(i) for i in {*casters, *receivers}}
    light = placed_light(request.light(index), request.camera)
    pairs = shading_pairs(light, {i: boxes[i] for i in casters}, {i: boxes[i] for i in receivers})
    return pairs or "its shadows fall on nothing that is in the picture"


def _called_for(request: RenderRequest) -> Iterator[Call | Refusal]:
    for index, light in enumerate(request.scene.lighting.lights):
        if light.shadow is not None:
            name, found = f'light "{light.name}"', _pairs(request, index)
            if isinstance(found, str):
                yield Refusal(name, found)
            else:
                yield Call(index, name, "it casts shadows")


def _unneeded(state: RenderState, target: Target) -> str | None:
    assert target is not None
    found = _pairs(state.request, target, state)
    return found if isinstance(found, str) else None


def _prepare(state: RenderState, target: Target) -> ShadowMap | None:
    """Rasterize the casters as a light sees them; None where none is before what is seen."""
    assert target is not None
    light: Light = state.lights[target]
    placed = state.of(PLACED_LIGHTS, target)
    assert light.shadow is not None
    pairs = _pairs(state.request, target, state)
    assert not isinstance(pairs, str)
    casters = sorted({caster for caster, _ in pairs})
    boxes = {i: box_of(state, i) for i in casters}
    shape = (light.shadow.size, light.shadow.size)
    if light.kind == "directional":
        seen = seen_bounds(state, placed, sorted({receiver for _, receiver in pairs}))
        view = parallel_view(light, placed, [(boxes[i], seen[j]) for i, j in pairs])
        if view is None:
            return None
        views, shape = view[0][None], view[1]
    else:
        views = perspective_views(light, placed, list(boxes.values()))
    modes = np.full(len(state.scene.objects), SKIP, np.uint8)
    modes[casters] = SHOW_BACK
    found = [
        rasterize(state.world, matrix, shape[1], shape[0], modes=modes, threads=state.threads)
        for matrix in views
    ]
    return ShadowMap(
        views=views,
        inverses=np.ascontiguousarray(np.linalg.inv(views)),
        depths=np.stack([item.depths for item in found]),
        face_ids=np.stack([item.face_ids for item in found]),
        radius=light.shadow.filter_radius,
    )


def _dim(fragments: Fragments, state: RenderState, index: int, incident: Incident) -> None:
    shadow = state.get(LIGHT_SHADOWS, index)
    if shadow is None or not state.plan.has("shadows", fragments.target):
        return
    light = state.of(PLACED_LIGHTS, index)
    first, stop = state.world.starts[fragments.target : fragments.target + 2]
    assert fragments.positions is not None and fragments.normals is not None
    incident.radiance = lit_radiance(
        shadow,
        light,
        state.world,
        fragments.positions,
        fragments.normals,
        fragments.drawn_faces + np.int32(first),
        incident,
        own=(int(first), int(stop)),
    )


def _shadows_called_for(request: RenderRequest) -> Iterator[Call]:
    for index, light in enumerate(request.scene.lighting.lights):
        found = _pairs(request, index) if light.shadow is not None else "it casts none"
        if not isinstance(found, str):
            for receiver in sorted({receiver for _, receiver in found}):
                why = f'shadows of light "{light.name}" may fall on it'
                yield Call(receiver, request.name(receiver), why)


LIGHT_SHADOWS = Result(_prepare)

SHADOW_MAPS = Effect(
    name="shadow maps",
    does="finds what lights see first",
    of="light",
    called_for=_called_for,
    left_out="no light casts shadows",
    needs=lambda request, target: ("lights",),
    unneeded=_unneeded,
    prepare=LIGHT_SHADOWS,
    dim=_dim,
)

# How maps are looked up is what `dim` does; what it needs is of the objects that receive.
SHADOWS = Effect(
    name="shadows",
    does="tells what lies in shadow",
    called_for=_shadows_called_for,
    left_out="no shadow falls on anything in the picture",
    needs=lambda request, target: ("positions",),
)
