"""A mesh to the same mesh with texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from texbake.building.memory import FLATTENED_FACE, IDLE_WORKER, faces_of
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.figures import stage_seconds
from texbake.building.steps.formats import MESH_FORMATS, check_format
from texbake.mapping.options import UnwrapOptions


@dataclass(frozen=True, kw_only=True)
class UnwrapStep(UnwrapOptions):
    """How coordinates are made; further attributes are those of `UnwrapOptions`.

    Attributes
    ----------
    format : str
    """

    format: str = "obj"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_format(self.format, MESH_FORMATS)


def _run(job: Job) -> dict[str, Any]:
    from texbake.mapping.unwrap import unwrap_with_report
    from texbake.mesh.files import read_mesh, write_mesh

    mesh = read_mesh(job.file("mesh"))
    unwrapped, report = unwrap_with_report(mesh, UNWRAP.made(job.settings), threads=job.threads)
    write_mesh(unwrapped, job.outputs["mesh"])
    measured = report.distortion
    return {
        "faces": report.n_faces,
        "charts": report.n_charts,
        "fill": report.fill,
        "stretch_l2": None if measured is None else measured.turned_stretch.l2,
        "notes": list(report.notes),
        "stages": stage_seconds(report.stages),
    }


def _memory(settings: Settings, sizes: Sizes) -> int:
    return IDLE_WORKER + FLATTENED_FACE * faces_of(sizes, "mesh")


UNWRAP = StepKind(
    name="unwrap",
    does="gives a mesh texture coordinates",
    options=UnwrapStep,
    without=("matrix",),
    inputs=(InputRole(name="mesh"),),
    outputs=lambda settings: {"mesh": f"unwrapped.{settings['format']}"},
    run=_run,
    memory=_memory,
)
