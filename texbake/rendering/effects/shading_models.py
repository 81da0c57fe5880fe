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

With a `shading_rate` of vertex (Gouraud shading), lamps, ambient light and light of the
environment, with their shadows and cookies, are evaluated at the corners of triangles alone, and
interpolated between them. So are normal maps and bump maps, which is why these show nothing between
the corners. Images of the base color, light maps, emission and mirrors are looked up at pixels as
always: at a corner the light that a white surface W and a black surface B reflect is found, and a
pixel of the base color C shows B + (W - B) C. That is exact for all models but for a surface that
is partly metal, whose light is not linear in C.

Based on: Gouraud, "Continuous shading of curved surfaces", IEEE Transactions on Computers 20(6),
1971; Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977;
Khronos, "glTF 2.0 Specification", 2021; Heitz, "Understanding the masking-shadowing function in
microfacet-based BRDFs", JCGT 3(2), 2014.

Kernel: `core/lamps.c`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.lights import incident
from texbake.rendering.fragments import Fragments, IncidentLight, three_weights
from texbake.rendering.request import RenderRequest

# Below this value of alpha, highlights are narrower than float32 normals resolve.
LEAST_ALPHA = 1e-3


def _shades(shading: str, request: RenderRequest, index: int) -> bool:
    return request.material(index).shading == shading and bool(request.shining)


def normals_effect(request: RenderRequest, target: int) -> str:
    """Name the effect that computes an object's normals before bump mapping."""
    has_map = request.material(target).normal_map is not None
    return "normal map" if has_map and request.needs_normals(target) else "normals"


def lamp_positions(request: RenderRequest, target: int) -> Iterator[str]:
    """Name the effect that finds positions, if a lamp shines from a point."""
    if any(request.light(index).kind != "directional" for index in request.shining):
        yield "positions"


def head_on(ior: float) -> float:
    """Reflectance at normal incidence for an index of refraction; 1 for an index of 0."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


_ONE = np.ones((1, 1), np.float32)


def add_lambert(
    normals: Float32Array, arriving: IncidentLight, base: Float32Array, light: Float32Array
) -> None:
    """Add a lamp's diffuse reflection to the outgoing light (n, 3) of points, in place."""
    core.reflect_lambert(normals, arriving.directions, arriving.radiance, base, light)


def _lambert(fragments: Fragments, light: IncidentLight) -> None:
    add_lambert(fragments.normals, light, fragments.values.base_color, fragments.light)


def _blinn_phong(fragments: Fragments, light: IncidentLight) -> None:
    values = fragments.values
    core.reflect_blinn_phong(
        fragments.normals, light.directions, light.radiance, fragments.to_eye,
        values.base_color, values.specular, values.exponent,
        _ONE if values.gloss is None else values.gloss, fragments.light,
    )  # fmt: skip


def _metallic(fragments: Fragments, light: IncidentLight) -> None:
    values = fragments.values
    core.reflect_metallic(
        fragments.normals, light.directions, light.radiance, fragments.to_eye,
        values.base_color, values.roughness, values.metalness,
        head_on(fragments.drawn.material.ior), LEAST_ALPHA, fragments.light,
    )  # fmt: skip


def _shade_lamps(
    reflect: Callable[[Fragments, IncidentLight], None],
) -> Callable[[Fragments, RenderState], None]:
    def shade(fragments: Fragments, state: RenderState) -> None:
        for index in state.request.shining:
            reflect(fragments, incident(fragments, state, index))

    return shade


def _show_base(fragments: Fragments, state: RenderState) -> None:
    fragments.light += fragments.values.base_color


UNLIT = Effect(
    name="unlit",
    does="shows the base color",
    after="bump map",
    when=lambda request, index: request.material(index).shading == "unlit",
    why="its shading is unlit",
    left_out="no material in the picture is unlit",
    needs=("slots",),
    shade=_show_base,
)

_VIEW = ("view directions",)
LAMBERT, BLINN_PHONG, METALLIC_ROUGHNESS = (
    Effect(
        name=shading,
        does=f"reflects lamps by {title}",
        after=after,
        among="lit",
        when=partial(_shades, shading),
        why=f"its shading is {shading}",
        left_out=f"no material in the picture is {shading}, or no lamp shines",
        needs=("slots", normals_effect, *looks, lamp_positions),
        shade=_shade_lamps(reflect),
        rate="vertex",
    )
    for shading, after, title, reflect, looks in (
        ("lambert", "ambient", "Lambert's law", _lambert, ()),
        ("blinn-phong", "lambert", "the model of Blinn and Phong", _blinn_phong, _VIEW),
        ("metallic-roughness", "blinn-phong", "the model of glTF 2.0", _metallic, _VIEW),
    )
)


# Faces shaded together.
_BAND = 1 << 12
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
_WHITE = np.ones((1, 3), np.float32)


@dataclass(frozen=True, eq=False)
class CornerLight:
    """Light at corners of drawn faces (F, 3, 3): of a black surface, and what white adds to it."""

    own: Float32Array
    reflected: Float32Array


def _corner_light(state: RenderState, target: int) -> CornerLight:
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


def _light(state: RenderState, target: int, faces: IntArray, base: Float32Array) -> Float32Array:
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
    first, second, third = np.moveaxis(drawn.positions[drawn.faces[faces]], 1, 0)
    away = pm.vecdot(np.cross(second - first, third - first), state.camera.eye - first) < 0.0
    return Fragments.on(
        target, drawn, faces, weights, changes, back_facing=np.ascontiguousarray(away)
    )


def _toward_eye(fragments: Fragments, state: RenderState) -> Float32Array:
    way = state.camera.eye - fragments.positions
    lengths = pm.norm(way, axis=1, keepdims=True)
    return np.ascontiguousarray(way / np.where(lengths > 0.0, lengths, 1.0), np.float32)


def _interpolate(fragments: Fragments, state: RenderState) -> None:
    corners = state.of(_corner_light, fragments.target)
    weights = three_weights(fragments.drawn_weights)
    own, reflected = (
        pm.vecmat(weights, values[fragments.drawn_faces])
        for values in (corners.own, corners.reflected)
    )
    fragments.light += own + reflected * fragments.values.base_color


VERTEX_LIGHT = Effect(
    name="vertex light",
    does="interpolates light between vertices",
    after="environment light",
    material_field="shading_rate",
    among="lit",
    why="its material is shaded per vertex",
    left_out="no material in the picture is shaded per vertex",
    needs=("slots", "positions"),
    prepare=_corner_light,
    shade=_interpolate,
    rate="pixel",
)
