"""What each effect of a picture contributes: the picture is drawn again without it.

An effect that changes no pixel of a picture is useless there, whatever it costs. Each effect of the
plan that can be taken out of the scene is taken out of all objects and lights at once, and the
picture is compared with the one that has it, in the 8-bit codes that an image file would hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.progress import ProgressSink
from texbake.rendering.camera import Camera
from texbake.rendering.exposure import exposed
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Ambient, Lighting
from texbake.rendering.scene.material import EMBOSS_FORMS, Material
from texbake.rendering.scene.scene import Scene, camera_of
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.encoding import quantize_srgb

_DEFAULTS = Material()


@dataclass(frozen=True, eq=False)
class Contribution:
    """What an effect changes in a picture, and what it costs."""

    name: str  # name of the effect in the plan
    pixels: int  # pixels whose 8-bit color differs without it
    share: float  # their share of all pixels, from 0 to 1
    largest: int  # largest difference of a channel, from 0 to 255
    # milliseconds, n_bytes: time of all threads and memory of its pass in the picture that has it
    milliseconds: float
    n_bytes: int
    difference: npt.NDArray[np.uint8]  # (H, W, 3): absolute difference of the codes

    def to_json(self) -> dict[str, Any]:
        """Return the numbers as plain values."""
        return {
            "name": self.name,
            "pixels": self.pixels,
            "share": self.share,
            "largest": self.largest,
            "milliseconds": self.milliseconds,
            "bytes": self.n_bytes,
        }


def contributions_of(
    scene: Scene,
    options: RenderOptions,
    frame: Frame,
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> tuple[Contribution, ...]:
    """Draw a scene without each of its effects in turn, and compare the pictures."""
    options = replace(options, max_error=None, time_budget=None)
    plain = replace(options, exposure="none")
    camera = camera or camera_of(scene, options)
    whole = frame
    if frame.sampling is not None:
        whole = render_scene(scene, options, camera=camera, threads=threads, progress=progress)
    shown = _codes(whole)
    found = []
    for item in frame.plan.passes:
        without = _WITHOUT.get(item.name)
        if without is None:
            continue
        other = render_scene(
            without(scene), plain, camera=camera, threads=threads, progress=progress
        )
        if whole.exposure is not None:
            (other,) = exposed([other], options, exposure=whole.exposure, threads=threads)
        # Opacity counts as a change, too.
        codes = _codes(other)
        difference = np.where(shown > codes, shown - codes, codes - shown)
        changed = difference.any(axis=2)
        cost = frame.costs.by_name.get(item.name)
        found.append(
            Contribution(
                name=item.name,
                pixels=int(changed.sum()),
                share=float(changed.mean()),
                largest=int(difference.max(initial=0)),
                milliseconds=0.0 if cost is None else 1e3 * cost.seconds,
                n_bytes=0 if cost is None else cost.n_bytes,
                difference=difference[..., :3],
            )
        )
    return tuple(found)


def _codes(frame: Frame) -> npt.NDArray[np.uint8]:
    """(H, W, 4) uint8: codes of the color, and opacity."""
    colors = np.asarray(quantize_srgb(frame.color[..., :3], 8), np.uint8)
    opacity = np.rint(255.0 * np.clip(frame.color[..., 3:], 0.0, 1.0)).astype(np.uint8)
    return np.concatenate([colors, opacity], axis=2)


def _materials(change: Callable[[Material], Material]) -> Callable[[Scene], Scene]:
    def without(scene: Scene) -> Scene:
        objects = tuple(replace(item, material=change(item.material)) for item in scene.objects)
        return replace(scene, objects=objects)

    return without


def _field(name: str) -> Callable[[Scene], Scene]:
    bare = {name: getattr(_DEFAULTS, name)}
    return _materials(lambda material: replace(material, **bare))


def _lighting(change: Callable[[Lighting], Lighting]) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, lighting=change(scene.lighting))


def _lights(**changes: Any) -> Callable[[Scene], Scene]:
    return _lighting(
        lambda lighting: replace(
            lighting, lights=tuple(replace(light, **changes) for light in lighting.lights)
        )
    )


def _environment(**changes: Any) -> Callable[[Scene], Scene]:
    def change(lighting: Lighting) -> Lighting:
        around = lighting.environment
        around = None if around is None else replace(around, **changes)
        return replace(lighting, environment=around)

    return _lighting(change)


def _without_textures(kind: type) -> Callable[[Scene], Scene]:
    """Take the textures of a kind out of the slots and maps of materials."""

    def change(material: Material) -> Material:
        bare: dict[str, Any] = {}
        for item in fields(material):
            value = getattr(material, item.name)
            held = getattr(value, "texture", None)
            if isinstance(value, kind) or isinstance(held, kind):
                bare[item.name] = getattr(_DEFAULTS, item.name)
            elif isinstance(getattr(value, "strength", None), kind):
                bare[item.name] = replace(value, strength=1.0)
        return replace(material, **bare)

    return _materials(change)


def _without_rendered(material: Material) -> Material:
    bare: dict[str, Any] = {
        name: replace(mirror, environment="scene")
        for name in ("reflection", "refraction")
        if (mirror := getattr(material, name)) is not None
    }
    return replace(material, **bare)


def _without_bumps(material: Material, *, embossed: bool) -> Material:
    bumps = material.bump_map
    if bumps is None or (bumps.form in EMBOSS_FORMS) != embossed:
        return material
    return replace(material, bump_map=None)


# The scene without an effect, by the name of the effect.
_WITHOUT: Mapping[str, Callable[[Scene], Scene]] = {
    "displacement": _field("displacement"),
    "lights": _lights(intensity=0.0),
    "shadow maps": _lights(shadow=None),
    "light profiles": _lights(profile=None),
    "background": _environment(background=False),
    "rendered environment": _materials(_without_rendered),
    "images": _without_textures(ImageTexture),
    "procedures": _without_textures(ProcedureTexture),
    "parallax": _field("parallax"),
    "projected textures": _field("projected"),
    "normal map": _field("normal_map"),
    "bump map": _materials(lambda material: _without_bumps(material, embossed=False)),
    "emboss": _materials(lambda material: _without_bumps(material, embossed=True)),
    "ambient occlusion": _lighting(lambda lighting: replace(lighting, occlusion=None)),
    "ambient": _lighting(lambda lighting: replace(lighting, ambient=Ambient())),
    "light map": _field("light_map"),
    "environment light": _environment(lighting=False),
    "vertex light": _field("shading_rate"),
    "refraction": _field("refraction"),
    "reflection": _field("reflection"),
    "emission": _field("emission"),
    "fog": _lighting(lambda lighting: replace(lighting, fog=None)),
    "transparency": _materials(lambda material: replace(material, alpha_mode="opaque")),
}
