"""The simplest material that looks the same, step by step.

A part is left out where its own values say that it shows nothing (a strength of 0, a black color),
or where another part hides it: a perfect mirror shows nothing of its own color, a black surface
reflects no light map, a highlight without color has no exponent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from texbake.records import dataclass
from texbake.rendering.maps import has_opacity
from texbake.rendering.scene.material import (
    DEFAULT_MATERIAL,
    EMBOSS_FORMS,
    Material,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture, Slot

if TYPE_CHECKING:
    from texbake.rendering.effect import Effect

# Name of an effect or a map, the reason why it is left out ("" where nobody would miss it), and
# the material without it.
Step = tuple[str, str, Material]
Simplify = Callable[[Material], Iterator[Step]]
BLACK = (0.0, 0.0, 0.0)
# Material slots that each shading model reads, in the order of their lookups.
SHADING_SLOTS = {
    "unlit": ("base_color",),
    "lambert": ("base_color",),
    "blinn-phong": ("base_color", "specular", "exponent", "gloss"),
    "metallic-roughness": ("base_color", "roughness", "metalness"),
}
ALWAYS_READ_SLOTS = ("emission", "opacity")
LIT_SLOTS = ("occlusion", "light_map")


@dataclass(frozen=True)
class Surroundings:
    """What may reach the objects of a scene."""

    # lamps, ambient, environment_light: whether there is light from lamps, ambient light, and light
    # from the environment
    lamps: bool
    ambient: bool
    environment_light: bool
    even: bool  # whether all light is the same from all sides
    environment: bool  # whether there is an environment for mirrors to show
    other_objects: bool  # whether there is more than one object


def simplifications(around: Surroundings, *, vertex_opacity: bool) -> tuple[Simplify, ...]:
    """Return the steps, in order, to the simplest material that looks the same."""
    twice = _without_unread_slots, partial(_without_what_mirrors_hide, around)
    unlit = partial(_without_unlit_parts, around)
    opacity = partial(_without_opacity, vertex_opacity)
    return opacity, _without_transmission, *twice, unlit, *twice


def _without_unread_slots(material: Material) -> Iterator[Step]:
    """Slots that the shading model does not read."""
    lit = LIT_SLOTS if material.shading != "unlit" else ()
    read = {*SHADING_SLOTS[material.shading], *ALWAYS_READ_SLOTS, *lit}
    every = {*ALWAYS_READ_SLOTS, *LIT_SLOTS, *(s for many in SHADING_SLOTS.values() for s in many)}
    unread = {
        name: getattr(DEFAULT_MATERIAL, name)
        for name in sorted(every - read)
        if _is_texture(getattr(material, name))
    }
    if unread:
        yield "slots", "", _replace(material, unread)


def _without_transmission(material: Material) -> Iterator[Step]:
    """Transmission where the surface scatters nothing that could come through instead."""
    if material.transmission is None:
        return
    for why, nothing in (
        (f"its shading is {material.shading}", material.shading != "metallic-roughness"),
        ("its base color is black", not is_diffuse(material)),
        ("it is a metal", not scatters(material)),
    ):
        if nothing:
            yield "transmission", why, replace(material, transmission=None)
            return


def _without_opacity(vertex_opacity: bool, material: Material) -> Iterator[Step]:
    if material.alpha_mode == "opaque":
        if material.opacity is not None:
            yield "opacity", "its alpha mode is opaque", replace(material, opacity=None)
        return
    least = material.alpha_cutoff if material.alpha_mode == "mask" else 0.0
    opacity = _factor_of(material.opacity)
    if material.alpha_mode == "mask" and opacity is not None and opacity >= least:
        # With another opacity it makes a product, which may be below the cutoff.
        base, of_image = material.base_color, _holds_opacity(material, "base_color")
        of_image = of_image and isinstance(base, ImageTexture) and has_opacity(base.image)
        if not (of_image or vertex_opacity):
            yield "opacity", "it is above the cutoff", replace(material, opacity=None)
        return
    if opacity is None or not (opacity < least or opacity <= 0.0):
        return
    hidden = Material(
        name=material.name, shading="unlit", base_color=BLACK, opacity=0.0,
        displacement=material.displacement, double_sided=material.double_sided,
    )  # fmt: skip
    if _is_richer(material, hidden):
        yield "slots", "its opacity leaves nothing to be seen", hidden


def without_zeros(effects: Sequence[Effect], material: Material) -> Iterator[Step]:
    """Parts whose strength is 0, as effects declare it, and textures whose factor is 0."""
    parts = [(each.name, each.material_field, each.strength) for each in effects]
    for name, part, key in [*parts, ("occlusion map", "occlusion", "")]:
        if key is None or getattr(material, part) is None:
            continue
        if why := _why_nothing(material, part, key):
            material = _replace(material, {part: None})
            yield name, why, material
    for slot, zero in _ZEROS.items():
        value = getattr(material, slot)
        if _is_texture(value) and _is_black(value):
            if _holds_opacity(material, slot) and has_opacity(value.image):
                continue
            material = _replace(material, {slot: zero})
            yield value.effect, f"the factor of {slot} is 0", material
    for part, key in (
        ("reflection", "strength"),
        ("refraction", "strength"),
        ("transmission", "thickness"),
    ):
        holder = getattr(material, part)
        found = getattr(holder, key, None)
        if _is_texture(found) and _is_black(found):
            material = _replace(material, {part: replace(holder, **{key: 0.0})})
            yield "images", f"the factor of {part}.{key} is 0", material


def _without_what_mirrors_hide(around: Surroundings, material: Material) -> Iterator[Step]:
    reflection, refraction = material.reflection, material.refraction
    if _is_perfect(reflection) and refraction is not None:
        refraction = None
        material = replace(material, refraction=None)
        yield "refraction", "the surface is a perfect mirror", material
    if _is_perfect(reflection) or _is_perfect(refraction):
        yield from _unlit(material, "the surface is a perfect mirror")
    is_dark = material.shading == "unlit" and not is_diffuse(material)
    if not is_dark or around.environment:
        return
    for name, mirror in (("refraction", refraction), ("reflection", reflection)):
        if mirror is not None:
            if mirror.environment == "rendered" and around.other_objects:
                return
            material = _replace(_dark(material), {name: None})
            yield name, "there is nothing to be seen in it", material


def _without_unlit_parts(around: Surroundings, material: Material) -> Iterator[Step]:
    """Parts for light that does not come, or that a black surface does not reflect."""
    if material.shading == "unlit":
        return
    lamps, surrounding = _reflects_lamps(material, around), _reflects_surroundings(material, around)
    light_map = material.light_map is not None and scatters(material)
    if material.light_map is not None and not light_map:
        material = replace(material, light_map=None)
        yield "light map", "its material reflects none of it", material
    if material.occlusion is not None and not surrounding:
        why = "there is no ambient light" if is_diffuse(material) else "it reflects none of it"
        material = replace(material, occlusion=None)
        yield "occlusion map", why, material
    through = material.transmission is not None
    if not (lamps or surrounding or light_map or through):
        yield from _unlit(material, "no light is reflected")
        return
    for slots, needed, why in (
        (("specular", "exponent", "gloss"), lamps, "no lamp shines"),
        (("exponent", "gloss"), not _is_black(material.specular), "its highlights are black"),
        (("specular", "exponent"), not _is_black(material.gloss), "its gloss is 0"),
        (("roughness",), lamps or around.environment_light or through, "there are no highlights"),
        (("metalness",), lamps or around.environment_light or light_map or through,
         "there are no highlights"),
    ):  # fmt: skip
        unneeded = [s for s in slots if not needed and _is_texture(getattr(material, s))]
        for slot in unneeded:
            effect = getattr(material, slot).effect
            material = _replace(material, {slot: _ZEROS.get(slot)})
            yield effect, f"{slot} shows nowhere, as {why}", material
    bump_map, embosses = material.bump_map, lamps and scatters(material)
    if bump_map is not None and bump_map.form in EMBOSS_FORMS and not embosses:
        material = replace(material, bump_map=None)
        yield "bump map", "no light is reflected", material
    if material.shading_rate == "vertex" and around.even and not _is_texture(material.occlusion):
        why = "its light is the same from all sides"
        yield "vertex light", why, replace(material, shading_rate="pixel")


def _unlit(material: Material, why: str) -> Iterator[Step]:
    """Show the surface black."""
    dark = _dark(material)
    if _is_richer(material, dark):
        yield "shading", why, dark


def _dark(material: Material) -> Material:
    """Return the material without any color of its own, but with its opacity."""
    opacity, base = material.opacity, material.base_color
    color: Slot = BLACK
    if _holds_opacity(material, "base_color"):
        assert isinstance(base, ImageTexture)
        if has_opacity(base.image):
            factor = 1.0 if opacity is None else _factor_of(opacity)
            if factor is None:  # two images hold it, so the base color must stay
                color = replace(base, factor=0.0)
            else:
                opacity = replace(base, channel=3, factor=factor, color=False)
    bump_map = material.bump_map
    if bump_map is not None and bump_map.form in EMBOSS_FORMS:
        bump_map = None
    unread = ("specular", "exponent", "gloss", "roughness", "metalness", "occlusion", "light_map")
    bare = _replace(material, {name: getattr(DEFAULT_MATERIAL, name) for name in unread})
    # Bumps count in mirrors of lit materials alone.
    bent = bump_map is not None and bool(material.reflection or material.refraction)
    shading = "lambert" if bent and material.shading != "unlit" else "unlit"
    return replace(
        bare, shading=shading, base_color=color, opacity=opacity, projected=(), bump_map=bump_map,
        transmission=None,
    )  # fmt: skip


def _replace(material: Material, changes: dict[str, Any]) -> Material:
    return replace(material, **changes)


def _is_richer(material: Material, other: Material) -> bool:
    """Whether a material has parts that another lacks."""
    return any(
        getattr(material, item.name) is not getattr(other, item.name)
        and getattr(material, item.name) != getattr(other, item.name)
        for item in fields(material)
        if item.name not in ("alpha_mode", "alpha_cutoff", "vertex_colors", "ior")
    )


def is_hidden(material: Material) -> bool:
    """Whether the opacity of a simplified material leaves nothing to be seen."""
    return material.alpha_mode != "opaque" and material.opacity == 0.0


def is_diffuse(material: Material) -> bool:
    """Whether the base color may reflect light."""
    return bool(material.projected) or not _is_black(material.base_color)


def scatters(material: Material) -> bool:
    """Whether a lit material may reflect diffuse light, which pure metals do not."""
    if material.shading == "metallic-roughness" and isinstance(material.metalness, float | int):
        return is_diffuse(material) and material.metalness < 1.0
    return is_diffuse(material)


def _reflects_lamps(material: Material, around: Surroundings) -> bool:
    if not around.lamps:
        return False
    if material.shading == "blinn-phong" and not _is_black(material.specular):
        return is_diffuse(material) or not _is_black(material.gloss)
    return is_diffuse(material) or material.shading == "metallic-roughness"


def _reflects_surroundings(material: Material, around: Surroundings) -> bool:
    """Whether ambient light or that of the environment is reflected."""
    if around.environment_light and reflects_environment(material):
        return True
    return around.ambient and is_diffuse(material)


def reflects_environment(material: Material) -> bool:
    """Whether a lit material reflects light of the environment."""
    return is_diffuse(material) or material.shading == "metallic-roughness"


def _is_perfect(mirror: Reflection | Refraction | None) -> bool:
    """Whether a mirror takes the place of the surface's own light everywhere."""
    if mirror is None or _is_texture(mirror.strength):
        return False
    return bool(np.all(np.asarray(mirror.strength) >= 1.0))


def _why_nothing(material: Material, part: str, key: str) -> str:
    """Why a part of a material changes nothing, by its own value or a key of it; "" if it may."""
    holder = getattr(material, part)
    if getattr(holder, "fresnel", False):  # grows toward grazing angles at any strength
        return ""
    if part == "occlusion":
        return "its strength is 0" if material.occlusion_strength == 0.0 else ""
    if not _is_black(getattr(holder, key) if key else holder):
        return ""
    return f"its {key} is 0" if key else "it is black"


def _holds_opacity(material: Material, slot: str) -> bool:
    """Whether the image of the base color may have a fourth channel that counts."""
    texture = material.base_color
    return (
        slot == "base_color"
        and isinstance(texture, ImageTexture)
        and material.alpha_mode != "opaque"
        and texture.channel is None
        and not texture.colors
    )


def _is_texture(slot: Any) -> bool:
    return isinstance(slot, ImageTexture | ProcedureTexture)


def _factor_of(slot: Slot | None) -> float | None:
    """Return the number that a slot holds, or 0 for a texture whose factor is 0."""
    if _is_black(slot):
        return 0.0
    return slot if isinstance(slot, float | int) else None


def _is_black(slot: Slot | None) -> bool:
    """Whether all values of a slot are 0 because its constant or its factor is."""
    value = slot.factor if isinstance(slot, ImageTexture | ProcedureTexture) else slot
    return value is not None and not np.any(np.asarray(value))


# What takes the place of a texture whose factor is 0.
_ZEROS: Mapping[str, float | tuple[float, float, float]] = MappingProxyType(
    {
        "base_color": BLACK, "specular": BLACK, "exponent": 0.0, "gloss": 0.0,
        "roughness": 0.0, "metalness": 0.0, "opacity": 0.0, "occlusion": 0.0,
    }
)  # fmt: skip
