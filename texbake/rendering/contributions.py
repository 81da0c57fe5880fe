"""What each effect of a picture contributes: the picture is drawn again without it.

An effect that changes no pixel of a picture is useless there, whatever it costs. Each effect of the
plan that can be taken out of the scene is taken out of all objects and lights at once, and the
picture is compared with the one that has it, in the 8-bit codes that an image file would hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.progress import ProgressSink
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.resolve import Frame, expose
from texbake.rendering.scene.scene import Scene, camera_of
from texbake.texture.encoding import quantize_srgb


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
    """Draw a scene without each of its effects in turn, and compare the pictures.

    Contributions are in the order of the plan. Geometry and lookups that other effects need are not
    among them; an effect that changed nothing has 0 pixels.
    """
    options = replace(options, max_error=None, time_budget=None)
    plain = replace(options, exposure="none")
    camera = camera or camera_of(scene, options)
    whole = frame
    if frame.sampling is not None:
        whole = render_scene(scene, options, camera=camera, threads=threads, progress=progress)
    shown = _codes(whole)
    found = []
    for item in frame.plan.passes:
        without = item.effect.scene_without(scene)
        if without is None:
            continue
        other = render_scene(without, plain, camera=camera, threads=threads, progress=progress)
        if whole.exposure is not None:
            (other,) = expose([other], options, exposure=whole.exposure, threads=threads)
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
