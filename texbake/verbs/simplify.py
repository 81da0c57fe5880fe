"""`simplify`: reduce the triangles of a mesh, to one level of detail or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import PROCESS, memory_left
from texbake.errors import OptionError
from texbake.files import PathLike, appearing_together
from texbake.mesh.options import MIN_FACES, SimplifyOptions, check_angle, check_target, error_limit
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Option
from texbake.verbs.step import FORMAT_OF_MESH, Job, Settings, n_faces, step_of
from texbake.verbs.verb import REPORT, THREADS, Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.mesh_output import MeshFileMaterials
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import FloatArray, Mesh
    from texbake.mesh.simplify import SimplifyReport
    from texbake.mesh.streamed.reduction import ReducedMesh
    from texbake.progress import Progress

_CLOSED = "the result was made from a closed surface around the mesh, with few tunnels"
_FACE = 125  # bytes of memory for each triangle of a mesh that is simplified in memory
_WHOLE = (
    "{mesh} was read whole, which exceeds `max_memory`: only binary PLY and STL files without "
    "texture coordinates, simplified to a small share of their triangles and without `error`, can "
    "be read in pieces"
)
_NOT_WHOLE = (
    "drop_hidden: {mesh} is too large to be read whole, and finding hidden parts needs the whole "
    "mesh; raise `max_memory`, or leave out `drop_hidden`"
)
_HIDDEN = "surfaces that are hardly seen from outside count less"
_MORE = "request more"
_CLOSE = f"{_MORE}, or use `topology` simplify, which closes holes and tunnels"


def _table(result: JobResult[SimplifyReport]) -> Rows:
    report, distance = result.report, result.report.distance
    return [
        ("triangles", f"{report.n_faces_before:,} to {report.n_faces:,}"),
        ("vertices", f"{report.n_vertices:,}"),
        ("method", report.method),
        (
            "distance, both ways",
            f"RMS {distance.rms:.4g} ± {distance.rms_error:.1g} "
            f"({100 * distance.rms_relative:.3f} % of the diagonal), "
            f"greatest {distance.max:.4g} ({100 * distance.max_relative:.3f} %)",
        ),
    ]


@verb(
    Reads("mesh"),
    Writes("output", "mesh", "The simplified mesh.", over="mesh"),
    Options(SimplifyOptions),
    REPORT,
    THREADS,
    examples="""
      texbake simplify scan.ply -o low.obj --faces 500
      texbake simplify scan.ply -o low.obj --faces 2000 --quality best
      texbake simplify scan.ply -o low.obj --error 0.1%
    """,
    table=_table,
)
def simplify_file(
    mesh: PathLike,
    output: PathLike,
    options: SimplifyOptions,
    *,
    report: PathLike | None = None,
    mtl: bool = True,
    threads: int | None = None,
    progress: Progress = None,
) -> JobResult[SimplifyReport]:
    """Reduce MESH to fewer triangles.

    Keeps boundaries, hard edges and seams of texture coordinates; GLB and OBJ files keep materials,
    too. Prints how many faces were reached and how far the two surfaces lie apart, measured both
    ways.
    """
    levels = [(options.n_faces, output)]
    (result,) = simplify_levels(mesh, levels, options, mtl=mtl, threads=threads, progress=progress)
    return result


@appearing_together()
def simplify_levels(
    mesh: PathLike,
    levels: Sequence[tuple[int | None, PathLike]],
    options: SimplifyOptions | None = None,
    *,
    mtl: bool = True,
    threads: int | None = None,
    progress: Progress = None,
) -> list[JobResult[SimplifyReport]]:
    """Write several levels of detail of a mesh file.

    Levels of an unwrapped mesh share its texture coordinates, so that the maps baked for it fit
    all of them; keep seams, so that no level loses its coordinates.
    """
    from texbake.jobs.outputs import check_mesh
    from texbake.mesh.objects import joined_objects
    from texbake.progress import Stages
    from texbake.raycast.orientation import oriented

    options = options or SimplifyOptions(n_faces=levels[0][0])
    if options.topology == "simplify" and options.seams == "keep":
        raise OptionError(
            "topology, seams: closing holes and tunnels leaves texture coordinates out, and "
            "`seams` keep never does; leave one of them out"
        )
    for count, output in levels:
        check_target(count, options.error)
        check_mesh(output)
    read, materials, source = _read(mesh, levels, options, threads, progress)
    notes: tuple[str, ...] = ()
    n_faces = read.n_faces
    if options.drop_hidden:
        with Stages(progress).stage("find hidden parts"):
            read, materials, notes = materials.without_hidden(read, threads=threads)
    if options.join_objects:
        read = joined_objects(read)
    with Stages(progress).stage("find outside"):
        # The file itself says which side an open surface shows.
        has_side = read.normals is not None or read.uvs is not None
        high, turned = oriented(read, options.orientation, keep_open=has_side, threads=threads)
    notes, importance = (*notes, *turned.notes), None
    if options.drop_hidden:
        with Stages(progress).stage("find hidden surfaces"):
            importance = materials.visible_shares(high, threads=threads)
    if options.max_memory is not None and source is None and read.n_faces > _most(options):
        notes = (*notes, _WHOLE.format(mesh=Path(mesh).name))
    results = []
    for count, output in levels:
        # Each from the mesh itself: the errors of levels made from one another add up.
        level = _level(
            high, source, materials, importance, count, output, options, mtl, threads, progress
        )
        figures = replace(level.report, notes=(*notes, *level.report.notes))
        if source is None:
            figures = replace(figures, n_faces_before=n_faces)
        results.append(replace(level, report=figures, warnings=(*figures.notes, *level.warnings)))
    return results


def _read(
    path: PathLike,
    levels: Sequence[tuple[int | None, PathLike]],
    options: SimplifyOptions,
    threads: int | None,
    progress: Progress,
) -> tuple[Mesh, MeshFileMaterials, ReducedMesh | None]:
    """Read a mesh, or what is left of one that is too large for memory."""
    from texbake.jobs.mesh_output import MeshFileMaterials, read_with_materials
    from texbake.mesh.rig import with_poses
    from texbake.mesh.streamed.mesh import StreamedMesh
    from texbake.mesh.streamed.reduction import ReducedMesh
    from texbake.mesh.streamed.source import open_source
    from texbake.progress import Stages

    most = _most(options)
    counts = [count for count, _ in levels if count is not None]
    # A triangle takes at least 8 bytes of a file. An error is measured on the mesh itself.
    if options.error is None and counts and _file_size(path) > 8 * most:
        source = open_source(path)
        if source is not None and source.n_rows > most and not source.has_uvs:
            if options.drop_hidden:
                raise OptionError(_NOT_WHOLE.format(mesh=Path(path).name))
            with Stages(progress).stage(f"reduce {Path(path).name} in pieces"):
                reduced = ReducedMesh.of(
                    StreamedMesh.open(source, threads=threads), max(counts), threads=threads
                )
            if reduced is not None:
                return reduced.mesh, MeshFileMaterials.read(path, reduced.mesh), reduced
    mesh, materials = read_with_materials(path, progress)
    return with_poses(mesh, materials.rig), materials, None


def _most(options: SimplifyOptions) -> int:
    """Most triangles of a mesh that is simplified in memory."""
    from texbake.mesh.streamed.reduction import MOST_IN_MEMORY

    if options.max_memory is None:
        return MOST_IN_MEMORY
    return min(MOST_IN_MEMORY, max(int(memory_left(options.max_memory, PROCESS) // _FACE), 0))


def _file_size(path: PathLike) -> int:
    return Path(path).stat().st_size if Path(path).is_file() else 0


def _level(
    high: Mesh,
    source: ReducedMesh | None,
    materials: MeshFileMaterials,
    importance: FloatArray | None,
    count: int | None,
    output: PathLike,
    options: SimplifyOptions,
    mtl: bool,
    threads: int | None,
    progress: Progress,
) -> JobResult[SimplifyReport]:
    """Write one level of detail."""
    from texbake.jobs.mesh_output import MaterialPartition, write_result
    from texbake.mapping.overlap import layout_notes
    from texbake.mesh.compose import excerpt
    from texbake.mesh.hard_edges import has_hard_edges, with_normals
    from texbake.mesh.objects import object_by_object
    from texbake.mesh.part_sizes import simplified_once
    from texbake.mesh.repeated_parts import RepeatedParts
    from texbake.mesh.simplify import check_count, measured_to, simplify_with_report
    from texbake.mesh.triangle_tree import with_nearest_attributes, with_source_hard_edges
    from texbake.mesh.wrapping import wraps

    repeated = None
    if options.error is None and options.topology != "simplify":
        rig = materials.rig_of(high, output)
        repeated = RepeatedParts.instances(high, materials.materials, rig)
    if repeated is not None:
        materials = materials.of_faces(repeated.is_first)
        high, importance = excerpt(repeated.mesh, repeated.is_first), None
    bordered = MaterialPartition.of(high, materials) if materials.fit(output, mtl=mtl) else None
    given = high if bordered is None else bordered.mesh

    def restored(made: Mesh) -> tuple[Mesh, MeshFileMaterials]:
        return (made, materials) if bordered is None else bordered.restored(made, high)

    def simplified(count: int | None) -> tuple[Mesh, SimplifyReport, MeshFileMaterials]:
        made, figures = simplify_with_report(
            given, count, error=options.error, quality=options.quality, seams=options.seams,
            source=source, importance=importance, threads=threads, progress=progress,
        )  # fmt: skip
        if importance is not None and made.n_faces < given.n_faces:
            figures = replace(figures, notes=(_HIDDEN, *figures.notes))
        low, of_low = restored(made)
        return low, figures, of_low

    if repeated is None or count is None:
        low, figures, of_low = simplified(count)
    else:
        low, figures, of_low = simplified_once(repeated, count, simplified, threads=threads)
    if options.error is None and options.seams != "keep":
        if options.topology == "simplify" and count is not None and not figures.is_whole:
            wrap, *_ = next(wraps(high, count, has_tunnels=True, threads=threads))
            low, figures = simplify_with_report(
                wrap, count, quality="best", threads=threads, progress=progress
            )
            figures = measured_to(figures, source or high, low, threads=threads)
            figures = replace(figures, notes=(_CLOSED, *figures.notes))
            low, of_low = restored(object_by_object(with_nearest_attributes(low, given, threads)))
        remedy = _MORE if options.topology == "simplify" else _CLOSE
        check_count(figures.n_faces, count, high.name, remedy)
    notes = (*figures.notes, *layout_notes(low, high, threads=threads))
    figures = replace(figures, notes=notes)
    if options.normals == "keep" and low.normals is None and has_hard_edges(given, threads=threads):
        low = with_source_hard_edges(low, given, threads=threads)
    low = with_normals(low, options.normals, angle=options.angle)
    if repeated is not None:
        low, faces = repeated.restored(low)
        of_low = of_low.of_faces(faces)
    return write_result(low, output, of_low, figures, mtl=mtl)


@dataclass(frozen=True, kw_only=True)
class _Levels(CheckedOptions):
    """Levels of detail, which stand before the options of each."""

    faces: Annotated[
        int | tuple[int, ...] | None,
        Option(
            "Triangles of each level of detail, the finest first; lod0 is the first.",
            low=MIN_FACES,
            default="one level, as small as the error allows",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class SimplifyStep(SimplifyOptions, _Levels):
    """How many triangles a mesh is reduced to."""

    format: Annotated[str, FORMAT_OF_MESH] = "obj"

    def __post_init__(self) -> None:
        if not self.levels:
            raise OptionError("faces: it is empty; give the triangles of at least one level")
        CheckedOptions.__post_init__(self)  # `n_faces` is not given
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


def _step(job: Job) -> dict[str, Any]:
    options: SimplifyStep = STEP.made(job.settings)
    levels = list(zip(options.levels, job.outputs.values(), strict=True))
    results = simplify_levels(job.file("mesh"), levels, options, mtl=False, threads=job.threads)
    return {
        "levels": [
            {
                "faces": level.report.n_faces,
                "distance_rms_relative": level.report.distance.rms_relative,
                "distance_max_relative": level.report.distance.max_relative,
                "notes": list(level.warnings),
            }
            for level in results
        ]
    }


def _levels(settings: Settings) -> dict[str, str]:
    levels = settings["faces"] if isinstance(settings["faces"], list) else [settings["faces"]]
    return {f"lod{level}": f"lod{level}.{settings['format']}" for level in range(len(levels))}


STEP = step_of(
    simplify_file,
    does="reduces a mesh to one or several levels of detail",
    options=SimplifyStep,
    without=("n_faces",),
    outputs=_levels,
    run=_step,
    memory=lambda settings, sizes: PROCESS + 300 * n_faces(sizes, "mesh"),
    revision=3,
)
