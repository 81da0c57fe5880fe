"""Steps on meshes: `make`, `repair`, `transform`, `remesh`, `simplify`, `unwrap`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any

from texbake.building.memory import (
    make_memory,
    remesh_memory,
    repair_memory,
    simplify_memory,
    unwrap_memory,
)
from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.options import (
    DEFAULT_ORIENTATION,
    TransformOptions,
    check_angle,
)
from texbake.mesh.parametric.options import MAX_TRIANGLES, SHAPES, MakeOptions
from texbake.mesh.remesh_options import RemeshOptions
from texbake.mesh.simplify_options import (
    DEFAULT_QUALITY,
    DEFAULT_SEAMS,
    ERROR_OPTION,
    MIN_FACES,
    SimplifyOptions,
    error_limit,
)
from texbake.schema import CheckedOptions, Option, option
from texbake.texture.procedures.options import PROCEDURE_NAMES
from texbake.verbs.step import (
    FORMAT_OF_MESH,
    Job,
    Settings,
    StepKind,
    stage_seconds,
    tupled,
)
from texbake.verbs.verb import Reads

_ORANGE = "orange"
_FILES = ("profile", "patches", "image")


@dataclass(frozen=True, kw_only=True)
class MakeStep(MakeOptions):
    """How a mesh is made; further options are those of `MakeOptions`."""

    shape: Annotated[
        str, Option("Shape of the mesh, as for texbake make.", choices=(*SHAPES, _ORANGE))
    ] = "sphere"
    triangles: Annotated[
        int,
        Option("Approximate number of triangles of an orange.", low=20, high=MAX_TRIANGLES),
    ] = 100_000
    relief: Annotated[
        str | None,
        Option(
            "Procedure that raises the surface along its normals.",
            choices=PROCEDURE_NAMES,
            default="none",
        ),
    ] = None
    relief_height: Annotated[
        float,
        Option("Height that a value of 1 raises the surface by.", unit="model units"),
    ] = 0.02
    relief_scale: Annotated[float, Option("Factor of positions for the procedure.")] = 8.0
    format: Annotated[str, FORMAT_OF_MESH] = "ply"


def _surface(settings: Settings, files: Mapping[str, Any]) -> MakeOptions:
    """Return those of the settings that are options of a parametric surface."""
    names = {item.name for item in fields(MakeOptions)} & settings.keys()
    return MakeOptions(**{name: tupled(settings[name]) for name in names}, **files)


def _check_shape(settings: Settings, roles: frozenset[str]) -> None:
    """Raise where the shape does not use what is given, or lacks what it needs."""
    if settings["shape"] != _ORANGE:
        _surface(settings, dict.fromkeys(roles, "given")).settings(settings["shape"])


def _make(job: Job) -> dict[str, Any]:
    from texbake.jobs.meshes import Relief, make_file

    settings = job.settings
    relief = None
    if settings["relief"] is not None:
        relief = Relief(
            procedure=settings["relief"],
            height=settings["relief_height"],
            scale=settings["relief_scale"],
        )
    (output,) = job.outputs.values()
    mesh = make_file(
        settings["shape"],
        output,
        _surface(settings, {role: job.input(role) for role in _FILES}),
        triangles=settings["triangles"],
        relief=relief,
        threads=job.threads,
    ).report
    return {"faces": mesh.n_faces, "vertices": mesh.n_vertices}


MAKE = StepKind(
    name="make",
    does="makes a mesh of a parametric surface",
    options=MakeStep,
    without=_FILES,
    required=("shape",),
    inputs=tuple(Reads(name, required=False) for name in _FILES),
    outputs=lambda settings: {"mesh": f"{settings['shape']}.{settings['format']}"},
    run=_make,
    memory=make_memory,
    check=_check_shape,
)


@dataclass(frozen=True, kw_only=True)
class TransformStep(TransformOptions):
    """How a mesh is moved; further options are those of `TransformOptions`."""

    format: Annotated[str, FORMAT_OF_MESH] = "ply"


def _transform(job: Job) -> dict[str, Any]:
    from texbake.jobs.convert import transform_file

    options = TRANSFORM.made(job.settings)
    done = transform_file(job.file("mesh"), job.outputs["mesh"], options, mtl=False)
    return {"faces": done.report.n_polygons, "notes": list(done.warnings)}


TRANSFORM = StepKind(
    name="transform",
    does="scales, turns and moves a mesh, or changes its format",
    options=TransformStep,
    without=(),
    inputs=(Reads("mesh"),),
    outputs=lambda settings: {"mesh": f"transformed.{settings['format']}"},
    run=_transform,
    memory=repair_memory,
)


@dataclass(frozen=True, kw_only=True)
class RemeshStep(RemeshOptions):
    """How a mesh is wrapped; further options are those of `RemeshOptions`."""

    format: Annotated[str, FORMAT_OF_MESH] = "ply"


def _remesh(job: Job) -> dict[str, Any]:
    from texbake.jobs.meshes import remesh_file

    options = REMESH.made(job.settings)
    done = remesh_file(job.file("mesh"), job.outputs["mesh"], options, threads=job.threads)
    return {
        "faces": done.report.n_faces,
        "components": done.report.n_components,
        "notes": list(done.warnings),
    }


REMESH = StepKind(
    name="remesh",
    does="wraps a mesh in a closed surface",
    options=RemeshStep,
    without=("n_faces", "quality"),
    inputs=(Reads("mesh"),),
    outputs=lambda settings: {"mesh": f"remeshed.{settings['format']}"},
    run=_remesh,
    memory=remesh_memory,
    revision=2,
)


@dataclass(frozen=True, kw_only=True)
class SimplifyStep(CheckedOptions):
    """How many triangles a mesh is reduced to."""

    faces: Annotated[
        int | tuple[int, ...] | None,
        Option(
            "Triangles of each level of detail, the finest first; lod0 is the first.",
            low=MIN_FACES,
            default="one level, as small as the error allows",
        ),
    ] = None
    error: Annotated[str | float | None, ERROR_OPTION] = None
    quality: Annotated[str, option(SimplifyOptions, "quality")] = DEFAULT_QUALITY
    seams: Annotated[str, option(SimplifyOptions, "seams")] = DEFAULT_SEAMS
    topology: Annotated[str, option(SimplifyOptions, "topology")] = SimplifyOptions.topology
    orientation: Annotated[str, option(SimplifyOptions, "orientation")] = DEFAULT_ORIENTATION
    join_objects: Annotated[bool, option(SimplifyOptions, "join_objects")] = False
    normals: Annotated[str, option(SimplifyOptions, "normals")] = SimplifyOptions.normals
    angle: Annotated[float, option(SimplifyOptions, "angle")] = SimplifyOptions.angle
    format: Annotated[str, FORMAT_OF_MESH] = "obj"

    def __post_init__(self) -> None:
        if not self.levels:
            raise OptionError("faces: it is empty; give the triangles of at least one level")
        super().__post_init__()
        if self.faces is None and self.error is None:
            raise OptionError("faces, error: neither is given; give one of them, or both")
        error_limit(self.error, 1.0)
        check_angle(self.normals, self.angle)
        if isinstance(self.faces, tuple) and any(
            fine <= coarse for fine, coarse in zip(self.faces, self.faces[1:], strict=False)
        ):
            raise OptionError("faces: each level must have fewer triangles than the one before")

    @property
    def levels(self) -> tuple[int | None, ...]:
        """Triangles of each level; None for as few as the error allows."""
        return self.faces if isinstance(self.faces, tuple) else (self.faces,)


def _simplify(job: Job) -> dict[str, Any]:
    from texbake.jobs.simplifying import simplify_levels

    options: SimplifyStep = SIMPLIFY.made(job.settings)
    levels = list(zip(options.levels, job.outputs.values(), strict=True))
    done = simplify_levels(
        job.file("mesh"),
        levels,
        error=options.error,
        quality=options.quality,
        seams=options.seams,
        topology=options.topology,
        orientation=options.orientation,
        join_objects=options.join_objects,
        normals=options.normals,
        angle=options.angle,
        mtl=False,
        threads=job.threads,
    )
    return {
        "levels": [
            {
                "faces": level.report.n_faces,
                "distance_rms_relative": level.report.distance.rms_relative,
                "distance_max_relative": level.report.distance.max_relative,
                "notes": list(level.warnings),
            }
            for level in done
        ]
    }


def _levels(settings: Settings) -> dict[str, str]:
    levels = settings["faces"] if isinstance(settings["faces"], list) else [settings["faces"]]
    return {f"lod{level}": f"lod{level}.{settings['format']}" for level in range(len(levels))}


SIMPLIFY = StepKind(
    name="simplify",
    does="reduces a mesh to one or several levels of detail",
    options=SimplifyStep,
    without=(),
    inputs=(Reads("mesh"),),
    outputs=_levels,
    run=_simplify,
    memory=simplify_memory,
    revision=2,
)


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
