"""Parts of a user's scene that knobs turn."""

from __future__ import annotations

from dataclasses import fields, replace

from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Shadow
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.textures import ImageTexture


def with_width(options: RenderOptions, width: int) -> RenderOptions:
    """Return options of a picture of another width and the same shape."""
    height = max(round(width * options.height / options.width), 1)
    return replace(options, width=width, height=height)


def has_image(scene: Scene) -> bool:
    """Whether a slot of any material holds an image, whose lookups can be filtered."""
    return any(
        isinstance(getattr(item.material, slot.name), ImageTexture)
        for item in scene.objects
        for slot in fields(item.material)
    )


def has_shadow(scene: Scene) -> bool:
    """Whether any light casts shadows."""
    return any(light.shadow is not None for light in scene.lighting.lights)


def with_shadows(scene: Scene, shadow: Shadow) -> Scene:
    """Return the scene with other shadow maps for all lights that have one."""
    lights = tuple(
        light if light.shadow is None else replace(light, shadow=shadow)
        for light in scene.lighting.lights
    )
    return replace(scene, lighting=replace(scene.lighting, lights=lights))
