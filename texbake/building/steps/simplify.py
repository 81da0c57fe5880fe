"""One mesh to lighter ones: a file for each level of detail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from texbake.building.memory import IDLE_WORKER, SIMPLIFIED_FACE, faces_of
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.formats import MESH_FORMATS, check_format
from texbake.errors import OptionError
from texbake.mesh.simplify_options import DEFAULT_QUALITY, MIN_FACES, QUALITIES


@dataclass(frozen=True, kw_only=True)
class SimplifyStep:
    """How light the meshes are to be.

    Attributes
    ----------
    faces : int or list of int
        Triangles of each level of detail, the finest first; `lod0` is the first.
    quality : str
        As of `simplify`.
    format : str
    """

    faces: int | tuple[int, ...] = 500
    quality: str = DEFAULT_QUALITY
    format: str = "obj"

    def __post_init__(self) -> None:
        check_format(self.format, MESH_FORMATS)
        if self.quality not in QUALITIES:
            raise OptionError(f"quality: {self.quality} is not one of {', '.join(QUALITIES)}")
        if not self.levels:
            raise OptionError("faces: it is empty; give the triangles of at least one level")
        for count in self.levels:
            if not isinstance(count, int) or isinstance(count, bool) or count < MIN_FACES:
                raise OptionError(f"faces: {count!r} is no whole number of at least {MIN_FACES}")
        if any(fine <= coarse for fine, coarse in zip(self.levels, self.levels[1:], strict=False)):
            raise OptionError("faces: each level must have fewer triangles than the one before")

    @property
    def levels(self) -> tuple[int, ...]:
        """Triangles of each level."""
        return self.faces if isinstance(self.faces, tuple) else (self.faces,)


def _run(job: Job) -> dict[str, Any]:
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.mesh.simplify import simplify_with_report

    options: SimplifyStep = SIMPLIFY.made(job.settings)
    mesh = read_mesh(job.file("mesh"))
    figures: dict[str, Any] = {"levels": []}
    for count, path in zip(options.levels, job.outputs.values(), strict=True):
        # Each from the mesh itself: errors of levels that are made of one another add up.
        light, report = simplify_with_report(
            mesh, count, quality=options.quality, threads=job.threads
        )
        write_mesh(light, path)
        distance = report.distance
        figures["levels"].append(
            {
                "faces": light.n_faces,
                "distance_rms_relative": distance.rms_relative,
                "distance_max_relative": distance.max_relative,
                "notes": list(report.notes),
            }
        )
    return figures


def _outputs(settings: Settings) -> dict[str, str]:
    levels = settings["faces"] if isinstance(settings["faces"], list) else [settings["faces"]]
    return {f"lod{level}": f"lod{level}.{settings['format']}" for level in range(len(levels))}


def _memory(settings: Settings, sizes: Sizes) -> int:
    return IDLE_WORKER + SIMPLIFIED_FACE * faces_of(sizes, "mesh")


SIMPLIFY = StepKind(
    name="simplify",
    does="makes a mesh lighter, to one or several levels of detail",
    options=SimplifyStep,
    without=(),
    required=("faces",),
    inputs=(InputRole(name="mesh"),),
    outputs=_outputs,
    run=_run,
    memory=_memory,
)
