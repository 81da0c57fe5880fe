"""A picture of a mesh, with its maps."""

from __future__ import annotations

from typing import Any

from texbake.building.memory import (
    IDLE_WORKER,
    MB,
    PIXEL_SAMPLE,
    READ_FACE,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.rendering.options import RenderOptions

_MAPS = ("normal_map", "displacement", "albedo")
# A triangle of those that displacement cuts a mesh into.
_CUT_FACE = 150


def _run(job: Job) -> dict[str, Any]:
    from texbake.mesh.files import read_mesh
    from texbake.rendering.render import render

    maps: dict[str, Any] = {name: job.input(name) for name in _MAPS}
    options = PREVIEW.made(job.settings)
    frame = render(read_mesh(job.file("mesh")), **maps, options=options, threads=job.threads)
    frame.write(job.outputs["picture"], threads=job.threads)
    return {}


def _memory(settings: Settings, sizes: Sizes) -> int:
    samples = settings["width"] * settings["height"] * settings["supersampling"] ** 2
    cut = _CUT_FACE * settings["max_triangles"] if sizes.get("displacement") else 0
    images = 40 * sum(size.n_bytes for name in _MAPS for size in sizes.get(name, ()))
    mesh = READ_FACE * faces_of(sizes, "mesh")
    return int(IDLE_WORKER + 64 * MB + PIXEL_SAMPLE * samples + mesh + images + cut)


PREVIEW = StepKind(
    name="preview",
    does="draws a mesh with its maps",
    options=RenderOptions,
    without=("time_budget",),
    inputs=(
        InputRole(name="mesh"),
        *(InputRole(name=name, required=False) for name in _MAPS),
    ),
    outputs=lambda settings: {"picture": "preview.png"},
    run=_run,
    memory=_memory,
)
