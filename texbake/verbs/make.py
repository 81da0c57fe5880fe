"""`make`: make meshes of parametric surfaces."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import PROCESS
from texbake.files import PathLike
from texbake.mesh.parametric.options import MAX_TRIANGLES, SHAPES, MakeOptions
from texbake.records import dataclass
from texbake.schema import Option, option_of
from texbake.texture.procedures.options import PROCEDURE_NAMES
from texbake.verbs.step import (
    FORMAT_OF_MESH,
    READ_FACE,
    Job,
    Settings,
    Sizes,
    lists_to_tuples,
    n_bytes,
    step_of,
)
from texbake.verbs.verb import Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import Mesh

_ORANGE = "orange"
# Files that shapes are made from, with their suffixes; `image` has those of all images.
_FILES: dict[str, tuple[str, ...]] = {
    "profile": (".txt", ".csv", ".dat"),
    "patches": (".txt", ".bpt", ".dat"),
    "image": (),
}


@dataclass(frozen=True, kw_only=True)
class Relief:
    """A procedure that raises a surface along its smooth normals, which cannot tear it."""

    procedure: str  # such as `worley`; its values are in 0 to 1
    # how far a value of 1 raises the surface, in model units; a negative one sinks it
    height: float = 0.02
    scale: float = 8.0  # factor of positions for the procedure


@verb(
    Extra("shape", choices=SHAPES, metavar="SHAPE"),
    Writes("output", "mesh", "The mesh."),
    Options(MakeOptions, without=tuple(_FILES)),
    *(
        Reads(
            name, name, option_of(MakeOptions, name).help, required=False, suffixes=suffixes,
            metavar="FILE",
        )
        for name, suffixes in _FILES.items()
    ),
    examples="""
      texbake make sphere -o ball.obj --resolution 256x128
      texbake make cylinder -o prism.obj --sides 6 --caps --height 3
      texbake make mobius -o strip.obj --twists 3
      texbake make revolution -o vase.glb --profile vase.txt --resolution 96x64
      texbake make bezier -o teapot.obj --patches teapot.txt --resolution 24
      texbake make height-field -o hill.ply --image hill.png --height 0.4
      texbake make cylindrical-range -o head.ply --image radius.exr --max-step 0.02
    """,
    table=lambda result: [
        ("faces", f"{result.report.n_faces:,}"),
        ("vertices", f"{result.report.n_vertices:,}"),
    ],
)  # fmt: skip
def make_file(
    shape: str,
    output: PathLike,
    options: MakeOptions | None = None,
    *,
    triangles: int = 100_000,
    relief: Relief | None = None,
    threads: int | None = None,
) -> JobResult[Mesh]:
    """Make a mesh of a parametric surface.

    SHAPE is plane, cylinder, cone, sphere, torus, mobius, revolution (a profile swept about y),
    bezier (bicubic patches, such as the classic teapot's), height-field, cylindrical-range (radii
    over angle and height, as scanners give them) or depth-image (of a depth camera). Every vertex
    has (u, v) as its texture coordinates. The default of an option shows the shapes that take it.
    """
    from texbake.jobs.outputs import JobResult, present_paths
    from texbake.mapping.corner_uvs import check_measurable
    from texbake.mesh.files import write_mesh
    from texbake.mesh.parametric.make import make
    from texbake.mesh.shapes import orange
    from texbake.texture.image import read_image

    options = options or MakeOptions()
    if shape == _ORANGE:
        mesh = orange(triangles)
    else:
        options.settings(shape)  # raises what is wrong with them
        if isinstance(options.image, str | os.PathLike):
            pixels = read_image(options.image, color=False, threads=threads).pixels
            options = replace(options, image=pixels)
        mesh = make(shape, options)
    if relief is not None:
        mesh = _raised(mesh, relief, threads)
    check_measurable(mesh)
    write_mesh(mesh, output)
    return JobResult(files=present_paths(output), report=mesh)


def _raised(mesh: Mesh, relief: Relief, threads: int | None) -> Mesh:
    from texbake.mesh.normals import smooth_normals
    from texbake.texture.procedures.evaluation import evaluate

    points = mesh.positions * relief.scale
    values = evaluate(relief.procedure, points, scalar=True, threads=threads)
    raised = relief.height * values.astype(float)
    normals = smooth_normals(mesh, threads=threads)
    return mesh.replace(
        positions=mesh.positions + raised * normals, normals=None, normal_faces=None
    )


@dataclass(frozen=True, kw_only=True)
class MakeStep(MakeOptions):
    """How a mesh is made; further options are those of `MakeOptions`."""

    shape: Annotated[
        str, Option("Shape of the mesh, as for texbake make.", choices=(*SHAPES, _ORANGE))
    ] = "sphere"
    triangles: Annotated[
        int, Option("Approximate number of triangles of an orange.", low=20, high=MAX_TRIANGLES)
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
        float, Option("Height that a value of 1 raises the surface by.", unit="model units")
    ] = 0.02
    relief_scale: Annotated[float, Option("Factor of positions for the procedure.")] = 8.0
    format: Annotated[str, FORMAT_OF_MESH] = "ply"


def _surface(settings: Settings, files: Mapping[str, Any]) -> MakeOptions:
    """Return those of the settings that are options of a parametric surface."""
    names = {item.name for item in fields(MakeOptions)} & settings.keys()
    return MakeOptions(**{name: lists_to_tuples(settings[name]) for name in names}, **files)


def _check_shape(settings: Settings, roles: frozenset[str]) -> None:
    """Raise where the shape does not use what is given, or lacks what it needs."""
    if settings["shape"] != _ORANGE:
        _surface(settings, dict.fromkeys(roles, "given")).settings(settings["shape"])


def _step(job: Job) -> dict[str, Any]:
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


def _memory(settings: Settings, sizes: Sizes) -> int:
    sides = settings["resolution"] or 128
    n_u, n_v = sides if isinstance(sides, list) else (sides, sides)
    n_faces = settings["triangles"] if settings["shape"] == _ORANGE else 2 * n_u * n_v
    return int(PROCESS + 2 * READ_FACE * n_faces + 8 * n_bytes(sizes, "image"))


STEP = step_of(
    make_file,
    does="makes a mesh of a parametric surface",
    options=MakeStep,
    without=tuple(_FILES),
    required=("shape",),
    outputs=lambda settings: {"mesh": f"{settings['shape']}.{settings['format']}"},
    run=_step,
    memory=_memory,
    check=_check_shape,
)
