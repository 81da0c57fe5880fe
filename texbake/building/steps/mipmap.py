"""An image to its mip levels, down to one texel: a folder with a file for each."""

from __future__ import annotations

from typing import Any

from texbake.building.memory import IDLE_WORKER, MB
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.texture.mip_options import MipOptions

# Bytes of floats that a byte of a compressed image may become, with half of it again for levels.
_INFLATED = 60


def _run(job: Job) -> dict[str, Any]:
    from texbake.texture.mip_files import write_mip_levels

    folder = job.outputs["levels"]
    folder.mkdir()
    files = write_mip_levels(
        job.file("image"), folder, MIPMAP.made(job.settings), threads=job.threads
    )
    return {"levels": len(files)}


def _memory(settings: Settings, sizes: Sizes) -> int:
    pixels = sum(_INFLATED * size.n_bytes for size in sizes.get("image", ()))
    return IDLE_WORKER + 64 * MB + pixels


MIPMAP = StepKind(
    name="mipmap",
    does="makes the mip levels of an image",
    options=MipOptions,
    without=(),
    inputs=(InputRole(name="image"),),
    outputs=lambda settings: {"levels": "levels"},
    run=_run,
    memory=_memory,
)
