"""A request for a picture: a scene, render options and a camera, and what follows from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from texbake.core import portable_math as pm
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.maps import has_opacity
from texbake.rendering.material_simplification import (
    ALWAYS_READ_SLOTS,
    LIT_SLOTS,
    SHADING_SLOTS,
    is_hidden,
)
from texbake.rendering.options import RenderOptions
from texbake.rendering.rasterize import Window
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.material import Material, Reflection, Refraction
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import (
    FILTERS_WITH_FOOTPRINT,
    ImageTexture,
    ProcedureTexture,
    Texture,
)
from texbake.rendering.scene_simplification import SkippedEffect, lights_object

AnyTexture = TypeVar("AnyTexture", bound=Texture)


@dataclass(frozen=True, eq=False)
class RenderRequest:
    """A scene, its render options and a camera; `keep` names data that the frame holds.

    `depth` counts nested pictures; `window` has the pixels to draw, None for all; `removed` lists
    what was taken out of the scene; with `keeps_materials`, the caller's effects may read what is
    left.
    """

    scene: Scene
    options: RenderOptions
    camera: Camera
    keep: frozenset[str] = frozenset()
    depth: int = 0
    window: Window | None = None
    removed: tuple[SkippedEffect, ...] = ()
    keeps_materials: bool = False

    @property
    def shows_buffer(self) -> bool:
        """Whether the picture shows a buffer of the renderer, so that nothing is shaded."""
        return self.options.buffer is not None

    @cached_property
    def in_view(self) -> tuple[int, ...]:
        """Objects that may be in the picture, by their bounding boxes."""
        return tuple(
            index
            for index, item in enumerate(self.scene.objects)
            if item.visible
            and (self.shows_buffer or self.keeps_materials or not is_hidden(item.material))
            and _in_view(item, self.camera, self.options)
        )

    @cached_property
    def shaded(self) -> tuple[int, ...]:
        """Objects that may be in the picture and are shaded."""
        return () if self.shows_buffer else self.in_view

    @cached_property
    def lit(self) -> tuple[int, ...]:
        """Shaded objects whose material is lit."""
        return tuple(i for i in self.shaded if self.material(i).shading != "unlit")

    @property
    def with_normals(self) -> tuple[int, ...]:
        """Objects whose normal and bump maps count: all that are shaded if normals are kept."""
        return self.shaded if "normals" in self.keep else self.lit

    @cached_property
    def shining(self) -> tuple[int, ...]:
        """Lights that are not dark, without spots that follow the camera and meet no object."""
        return tuple(
            index
            for index, light in enumerate(self.scene.lighting.lights)
            if light.shines
            and (
                light.kind != "spot"
                or not light.follows_camera
                or any(lights_object(light, item, self.camera) for item in self.scene.objects)
            )
        )

    def material(self, index: int) -> Material:
        """Material of an object."""
        return self.scene.objects[index].material

    def name(self, index: int) -> str:
        """Name of an object in the plan."""
        return f'object "{self.scene.objects[index].name}"'

    @property
    def objects(self) -> range:
        """All objects."""
        return range(len(self.scene.objects))

    @property
    def lights(self) -> range:
        """All lights."""
        return range(len(self.scene.lighting.lights))

    def light_name(self, index: int) -> str:
        """Name of a light in the plan."""
        return f'light "{self.light(index).name}"'

    def light(self, index: int) -> Light:
        """Return a light by its index."""
        return self.scene.lighting.lights[index]

    def slots(self, index: int) -> tuple[str, ...]:
        """Slots of an object's material that its shading model reads, filled or not."""
        material = self.material(index)
        lit = LIT_SLOTS if material.shading != "unlit" else ()
        names = SHADING_SLOTS[material.shading] + ALWAYS_READ_SLOTS + lit
        return tuple(name for name in names if getattr(material, name) is not None)

    def textures(self, index: int) -> Iterator[tuple[str, Texture]]:
        """Textures that shading an object looks up, each with its place in the material."""
        yield from self._looked_up(index, (*_features(self.material(index)), "parallax"))

    def textures_of(self, index: int, kind: type[AnyTexture]) -> Iterator[tuple[str, AnyTexture]]:
        """Those of `textures` that are of a kind."""
        for name, texture in self.textures(index):
            if isinstance(texture, kind):
                yield name, texture

    def _looked_up(self, index: int, features: Sequence[str]) -> Iterator[tuple[str, Texture]]:
        material = self.material(index)
        for name in self.slots(index):
            slot = getattr(material, name)
            if isinstance(slot, ImageTexture | ProcedureTexture):
                yield name, slot
        opacity = self.image_opacity(index)
        if opacity is not None:
            yield "base_color.opacity", opacity
        for feature in features:
            holder = getattr(material, feature)
            if holder is None or not self._looks_up(feature, index):
                continue
            for field in fields(holder):
                value = getattr(holder, field.name)
                if isinstance(value, ImageTexture | ProcedureTexture):
                    yield f"{feature}.{field.name}", value

    def _looks_up(self, feature: str, index: int) -> bool:
        """Whether shading an object looks up the textures of a feature of its material."""
        if feature == "normal_map":
            return self.needs_normals(index)
        if feature == "parallax":
            return self.moves_textures(index)
        kept = self.shows_buffer or "normals" in self.keep
        lit = self.material(index).shading != "unlit" and self.needs_normals(index)
        return feature != "bump_map" or kept or lit

    def needs_normals(self, index: int) -> bool:
        """Whether a picture depends on the normals of an object."""
        if self.shows_buffer or "normals" in self.keep:
            return True
        material = self.material(index)
        return (
            self._shows(material.reflection)
            or self._shows(material.refraction)
            or material.transmission is not None
            or self._is_lit_from_sides(index)
        )

    def _shows(self, mirror: Reflection | Refraction | None) -> bool:
        """Whether what a mirror adds depends on the direction in which it is seen."""
        if mirror is None:
            return False
        grows = isinstance(mirror, Reflection) and mirror.fresnel
        around = self.scene.lighting.environment
        has_one_color = around is None or (around.image is None and not around.faces)
        return grows or not (mirror.environment == "scene" and has_one_color)

    def _is_lit_from_sides(self, index: int) -> bool:
        """Whether the light on an object comes from some directions more than from others."""
        lighting, shading = self.scene.lighting, self.material(index).shading
        if shading == "unlit":
            return False
        if self.shining:
            return True
        if lighting.ambient.ground not in (None, lighting.ambient.color):
            return True
        around = lighting.environment
        if around is None or not around.lighting:
            return False
        # One color all around shows only in highlights.
        return bool(around.image is not None or around.faces or shading == "metallic-roughness")

    def moves_textures(self, index: int) -> bool:
        """Whether something is looked up where the parallax of an object leads."""
        return (
            self.shows_buffer
            or self.keeps_materials
            or any(
                texture.is_over_uvs
                for _, texture in self._looked_up(index, _features(self.material(index)))
            )
        )

    def uv_sets(self, index: int) -> tuple[str, ...]:
        """Further sets of texture coordinates that shading an object looks up."""
        named = (texture.uv_set for _, texture in self.textures(index) if texture.is_over_uvs)
        return tuple(dict.fromkeys(name for name in named if name is not None))

    def image_opacity(self, index: int) -> ImageTexture | None:
        """Alpha channel of the base color's image, if there is one and it counts as opacity."""
        if index not in self._image_opacities:
            self._image_opacities[index] = _image_opacity(self.material(index))
        return self._image_opacities[index]

    @cached_property
    def _image_opacities(self) -> dict[int, ImageTexture | None]:
        """Cache, since the file must be opened to find out whether it has an alpha channel."""
        return {}

    def filter_of(self, texture: ImageTexture) -> str:
        """Filter of a texture: the one in the options if set, else the texture's own."""
        return self.options.filter or texture.filter

    def wants_footprint(self, texture: Texture) -> bool:
        """Whether a texture's filter needs the footprint of the pixel."""
        if isinstance(texture, ProcedureTexture):
            return texture.filtered and self.options.filter not in ("nearest", "bilinear")
        return self.filter_of(texture) in FILTERS_WITH_FOOTPRINT


def _features(material: Material) -> list[str]:
    """Features of a material whose textures are looked up, and moved by parallax."""
    values = {item.name: getattr(material, item.name) for item in fields(material)}
    return [
        name
        for name, value in values.items()
        if is_dataclass(value)
        and not isinstance(value, ImageTexture | ProcedureTexture)
        and name not in ("displacement", "parallax")
    ]


def _image_opacity(material: Material) -> ImageTexture | None:
    texture = material.base_color
    if material.alpha_mode == "opaque" or not isinstance(texture, ImageTexture):
        return None
    if texture.channel is not None or texture.colors or not has_opacity(texture.image):
        return None
    return replace(texture, channel=3, factor=1.0, color=False)


def _in_view(item: SceneObject, camera: Camera, options: RenderOptions) -> bool:
    """Whether an object's box may overlap the picture; displaced objects may leave theirs."""
    if item.material.displacement is not None:
        return True
    corners = item.box_corners()
    matrix = camera.clip_from_world(options.width / options.height)
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z, w = pm.matmul(matrix, np.concatenate([corners, np.ones((8, 1))], axis=1).T)
        outside = (x < -w).all() or (x > w).all() or (y < -w).all() or (y > w).all()
        return not (outside or (z > w).all())
