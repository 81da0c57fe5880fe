"""Pictures of one scene drawn with several options, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from texbake.progress import ProgressSink
from texbake.rendering.camera import Camera
from texbake.rendering.draw import prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import draw_picture
from texbake.rendering.resolve import Frame, expose
from texbake.rendering.scene.scene import Scene, camera_of
from texbake.texture.image import FloatImage


def side_by_side_options(
    options: RenderOptions, choices: Mapping[str, Sequence[str]]
) -> list[tuple[str, RenderOptions]]:
    """Return options for every combination of choices by option name, each with a caption."""
    several = {name: tuple(words) for name, words in choices.items() if words}
    combined = []
    for choice in product(*several.values()):
        changes: dict[str, Any] = dict(zip(several, choice, strict=True))
        combined.append((", ".join(choice), replace(options, **changes)))
    return combined


def render_side_by_side(
    scene: Scene,
    variants: Sequence[tuple[str, RenderOptions]],
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> tuple[FloatImage, list[Frame]]:
    """Draw a scene with several options and one exposure, and put the pictures side by side.

    Returns `color` (H, W, 3) float32, linear, with a caption below each picture.
    """
    frames = []
    for _, options in variants:
        prepared = prepare(scene, replace(options, exposure="none"), threads=threads)
        frames.append(
            draw_picture(prepared, camera or camera_of(scene, options), progress=progress)
        )
    if all(options.exposes for _, options in variants):
        frames = expose(frames, variants[0][1], threads=threads)
    from texbake.rendering.panels import Panel, side_by_side

    panels = [
        Panel(frame.color, caption, "")
        for frame, (caption, _) in zip(frames, variants, strict=True)
    ]
    shown = np.ones(frames[0].coverage.shape, bool)
    return side_by_side(panels, shown), frames
