"""A picture as its options ask for it: given samples, or as many as it needs."""

from __future__ import annotations

from collections.abc import Collection

from texbake.progress import ProgressSink
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, draw
from texbake.rendering.resolve import Frame


def draw_picture(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw a scene from one camera, until an error is reached or a time spent where that is asked.

    Parameters are those of `texbake.rendering.draw.draw`, as are the errors.
    """
    if not prepared.options.is_adaptive:
        return draw(prepared, camera, keep=keep, progress=progress)
    # Loaded here, so that no other picture has anything of it.
    from texbake.rendering.adaptive import draw_adaptively

    return draw_adaptively(prepared, camera, keep=keep, progress=progress)
