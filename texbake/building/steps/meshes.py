"""The step `unwrap`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from texbake.building.memory import unwrap_memory
from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions
from texbake.verbs.step import FORMAT_OF_MESH, Job, StepKind, stage_seconds
from texbake.verbs.verb import Reads


@dataclass(frozen=True, kw_only=True)
class UnwrapStep(UnwrapOptions):
    """How a mesh is unwrapped; further options are those of `UnwrapOptions`."""

    format: Annotated[str, FORMAT_OF_MESH] = "obj"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.uv_set is not None and self.format != "glb":
            raise OptionError("uv_set: a product has no file beside it; set format = 'glb'")


def _unwrap(job: Job) -> dict[str, Any]:
    from texbake.jobs.unwrapping import unwrap_files

    done = unwrap_files(
        job.file("mesh"),
        job.outputs["mesh"],
        UNWRAP.made(job.settings),
        mtl=False,
        threads=job.threads,
    )
    (report,) = done.report
    measured = report.distortion
    return {
        "faces": report.n_faces,
        "charts": report.n_charts,
        "fill": report.fill,
        "stretch_l2": None if measured is None else measured.turned_stretch.l2,
        "notes": list(report.notes),
        "stages": stage_seconds(report.stages),
    }


UNWRAP = StepKind(
    name="unwrap",
    does="gives a mesh texture coordinates",
    options=UnwrapStep,
    without=("matrix",),
    inputs=(Reads("mesh"),),
    outputs=lambda settings: {"mesh": f"unwrapped.{settings['format']}"},
    run=_unwrap,
    memory=unwrap_memory,
    revision=2,
)
