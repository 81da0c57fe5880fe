"""Shading models for the light of lamps: unlit, Lambert, Blinn-Phong and metallic-roughness.

With C_b the base color, I_L the arriving light, N the unit normal, L and V unit vectors to the
light and to the camera, and H halfway between L and V, a lamp in front of the surface adds

    Lambert              I_L C_b (N·L)
    Blinn-Phong          I_L (C_b (N·L) + C_s (N·H)^e)
    metallic-roughness   I_L (N·L) ((1 - F) (1 - metalness) C_b + pi D V F)

where F is Schlick's approximation with F_0 = mix(((ior - 1) / (ior + 1))^2, C_b, metalness), D the
distribution of Trowbridge and Reitz, and V Smith's visibility term, as defined in glTF 2.0
(appendix B). V is in its height-correlated form, as in Khronos' sample viewer. The factor pi
appears because I_L is defined as the light that a white Lambert surface reflects.

Based on: Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977;
Khronos, "glTF 2.0 Specification", 2021; Heitz, "Understanding the masking-shadowing function in
microfacet-based BRDFs", JCGT 3(2), 2014.

Kernel: `core/lamps.c`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from texbake.core import core
from texbake.rendering.effect import Call, Effect, RenderState
from texbake.rendering.effects.lights import incident
from texbake.rendering.fragments import Floats, Fragments, Incident
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target

# Below this value of alpha, highlights are narrower than float32 normals resolve.
LEAST_ALPHA = 1e-3


def _called_for(shading: str) -> Callable[[RenderRequest], Iterator[Call]]:
    def called_for(request: RenderRequest) -> Iterator[Call]:
        for index in request.lit:
            if request.material(index).shading == shading and request.shining:
                yield Call(index, request.name(index), f"its shading is {shading}")

    return called_for


def normals_effect(request: RenderRequest, target: int) -> str:
    """Name the effect that computes an object's normals before bump mapping."""
    has_map = request.material(target).normal_map is not None
    return "normal map" if has_map and request.needs_normals(target) else "normals"


def _needs(request: RenderRequest, target: Target) -> Iterator[str]:
    assert target is not None
    yield from ("slots", normals_effect(request, target))
    if request.material(target).shading != "lambert":
        yield "view directions"
    if any(request.light(index).kind != "directional" for index in request.shining):
        yield "positions"


def head_on(ior: float) -> float:
    """Reflectance at normal incidence for an index of refraction; 1 for an index of 0."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


_ONE = np.ones((1, 1), np.float32)


def add_lambert(normals: Floats, arriving: Incident, base: Floats, light: Floats) -> None:
    """Add a lamp's diffuse reflection to the outgoing light (n, 3) of points, in place."""
    core.reflect_lambert(normals, arriving.directions, arriving.radiance, base, light)


def _lambert(fragments: Fragments, light: Incident) -> None:
    assert fragments.normals is not None
    add_lambert(fragments.normals, light, fragments.values.base_color, fragments.light)


def _blinn_phong(fragments: Fragments, light: Incident) -> None:
    values = fragments.values
    core.reflect_blinn_phong(
        fragments.normals, light.directions, light.radiance, fragments.to_eye,
        values.base_color, values.specular, values.exponent,
        _ONE if values.gloss is None else values.gloss, fragments.light,
    )  # fmt: skip


def _metallic(fragments: Fragments, light: Incident) -> None:
    values = fragments.values
    core.reflect_metallic(
        fragments.normals, light.directions, light.radiance, fragments.to_eye,
        values.base_color, values.roughness, values.metalness,
        head_on(fragments.drawn.material.ior), LEAST_ALPHA, fragments.light,
    )  # fmt: skip


def _reflecting(
    reflect: Callable[[Fragments, Incident], None],
) -> Callable[[Fragments, RenderState], None]:
    def shade(fragments: Fragments, state: RenderState) -> None:
        for index in state.request.shining:
            reflect(fragments, incident(fragments, state, index))

    return shade


def _unlit_called_for(request: RenderRequest) -> Iterator[Call]:
    for index in request.shaded:
        if request.material(index).shading == "unlit":
            yield Call(index, request.name(index), "its shading is unlit")


def _show_base(fragments: Fragments, state: RenderState) -> None:
    fragments.light += fragments.values.base_color


UNLIT = Effect(
    name="unlit",
    does="shows the base color",
    called_for=_unlit_called_for,
    left_out="no material in the picture is unlit",
    needs=lambda request, target: ("slots",),
    shade=_show_base,
)

LAMBERT, BLINN_PHONG, METALLIC_ROUGHNESS = (
    Effect(
        name=shading,
        does=f"reflects lamps by {title}",
        called_for=_called_for(shading),
        left_out=f"no material in the picture is {shading}, or no lamp shines",
        needs=_needs,
        shade=_reflecting(reflect),
        rate="vertex",
    )
    for shading, title, reflect in (
        ("lambert", "Lambert's law", _lambert),
        ("blinn-phong", "the model of Blinn and Phong", _blinn_phong),
        ("metallic-roughness", "the model of glTF 2.0", _metallic),
    )
)
