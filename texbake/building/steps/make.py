"""A mesh made by code: a parametric surface or an orange, maybe in relief."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.building.memory import IDLE_WORKER, READ_FACE
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
    tupled,
)
from texbake.building.steps.formats import MESH_FORMATS, check_format
from texbake.errors import OptionError
from texbake.mesh.parametric.options import MAX_TRIANGLES, SHAPES, MakeOptions
from texbake.texture.procedures.options import PROCEDURE_NAMES

if TYPE_CHECKING:
    from texbake.mesh.mesh import Mesh

ORANGE = "orange"
_FILES = ("profile", "patches", "image")


@dataclass(frozen=True, kw_only=True)
class MakeStep(MakeOptions):
    """What a mesh is made of; further attributes are those of `MakeOptions`.

    Attributes
    ----------
    shape : str
        A shape of `texbake make`, or `orange`.
    triangles : int
        Of an orange, about.
    relief : str, optional
        A procedure, such as `worley`, whose values the surface is raised by along its normals.
    relief_height : float
        How far a value of 1 raises it, in model units; negative ones sink it.
    relief_scale : float
        Positions are multiplied by it for the procedure.
    format : str
    """

    shape: str = "sphere"
    triangles: int = 100_000
    relief: str | None = None
    relief_height: float = 0.02
    relief_scale: float = 8.0
    format: str = "ply"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_format(self.format, MESH_FORMATS)
        if self.shape not in (*SHAPES, ORANGE):
            raise OptionError(f"shape: {self.shape} is not one of {', '.join((*SHAPES, ORANGE))}")
        if not isinstance(self.triangles, int) or not 20 <= self.triangles <= MAX_TRIANGLES:
            raise OptionError(f"triangles: {self.triangles} is not from 20 to {MAX_TRIANGLES:,}")
        if self.relief is not None and self.relief not in PROCEDURE_NAMES:
            raise OptionError(f"relief: {self.relief} is not one of {', '.join(PROCEDURE_NAMES)}")
        if not all(map(math.isfinite, (self.relief_height, self.relief_scale))):
            raise OptionError("relief_height, relief_scale: give finite numbers")


def _check(settings: Settings, roles: frozenset[str]) -> None:
    """Raise where the shape does not read what is given, or lacks what it needs."""
    if settings["shape"] != ORANGE:
        surface_options(settings, dict.fromkeys(roles, "given")).settings(settings["shape"])


def surface_options(settings: Settings, files: Mapping[str, Any]) -> MakeOptions:
    """Of the settings, those of a parametric surface."""
    names = {item.name for item in fields(MakeOptions)} & settings.keys()
    return MakeOptions(**{name: tupled(settings[name]) for name in names}, **files)


def _run(job: Job) -> dict[str, Any]:
    from texbake.mesh.files import write_mesh

    mesh = _made(job)
    if job.settings["relief"] is not None:
        mesh = _in_relief(mesh, job)
    (path,) = job.outputs.values()
    write_mesh(mesh, path)
    return {"faces": mesh.n_faces, "vertices": mesh.n_vertices}


def _made(job: Job) -> Mesh:
    from texbake.mesh.parametric.make import make
    from texbake.mesh.shapes import orange
    from texbake.texture.image import read_image

    if job.settings["shape"] == ORANGE:
        return orange(job.settings["triangles"])
    sources: dict[str, Any] = {role: job.input(role) for role in _FILES}
    if sources["image"] is not None:
        sources["image"] = read_image(sources["image"], color=False, threads=job.threads).pixels
    return make(job.settings["shape"], surface_options(job.settings, sources))


def _in_relief(mesh: Mesh, job: Job) -> Mesh:
    """Raise a mesh along its smooth normals, which cannot tear it; its own normals are gone."""
    from texbake.mesh.normals import smooth_normals
    from texbake.texture.procedures.evaluation import evaluate

    settings = job.settings
    points = mesh.positions * settings["relief_scale"]
    values = evaluate(settings["relief"], points, scalar=True, threads=job.threads)
    raised = settings["relief_height"] * values.astype(float)
    normals = smooth_normals(mesh, threads=job.threads)
    return mesh.replace(
        positions=mesh.positions + raised * normals, normals=None, normal_faces=None
    )


def _memory(settings: Settings, sizes: Sizes) -> int:
    sides = settings["resolution"] or 128
    n_u, n_v = sides if isinstance(sides, list) else (sides, sides)
    n_faces = settings["triangles"] if settings["shape"] == ORANGE else 2 * n_u * n_v
    images = sum(8 * size.n_bytes for size in sizes.get("image", ()))
    return int(IDLE_WORKER + 2 * READ_FACE * n_faces + images)


def _outputs(settings: Settings) -> dict[str, str]:
    return {"mesh": str(Path(settings["shape"]).with_suffix("." + settings["format"]))}


MAKE = StepKind(
    name="make",
    does="makes a mesh by code",
    options=MakeStep,
    without=_FILES,
    required=("shape",),
    inputs=tuple(InputRole(name=name, required=False) for name in _FILES),
    outputs=_outputs,
    run=_run,
    memory=_memory,
    check=_check,
)
