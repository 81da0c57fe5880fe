"""A picture as its options ask for it: given samples, or as many as it needs."""

from __future__ import annotations

from collections.abc import Collection

from texbake.progress import ProgressSink
from texbake.render.camera import Camera
from texbake.render.draw import Prepared, draw
from texbake.render.resolve import Frame


def draw_picture(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw a scene from one camera, until an error is reached or a time spent where that is asked.

    Parameters are those of `texbake.render.draw.draw`, as are the errors.
    """
    if not prepared.options.is_adaptive:
        return draw(prepared, camera, keep=keep, progress=progress)
    # Loaded here, so that no other picture has anything of it.
    from texbake.render.adaptive import draw_adaptively

    return draw_adaptively(prepared, camera, keep=keep, progress=progress)
