"""`repair`, `transform`, `convert`, `remesh` and `cage`: from one mesh, or two, to another."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import PROCESS
from texbake.files import PathLike
from texbake.mesh.options import RemeshOptions, RepairOptions, TransformOptions
from texbake.verbs.step import FORMAT_OF_MESH, Settings, Sizes, n_faces, step_of
from texbake.verbs.verb import REPORT, THREADS, Extra, Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.baking.cage import Cage
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import Mesh
    from texbake.mesh.remesh import RemeshReport
    from texbake.mesh.repair import RepairReport
    from texbake.progress import Progress


@verb(
    Reads("mesh"),
    Writes("output", "mesh", "The repaired mesh; it may replace MESH.", over="mesh"),
    Options(RepairOptions),
    examples="""
      texbake repair scan.ply -o clean.ply
      texbake repair model.obj -o clean.obj --no-winding
    """,
    table=lambda result: [
        ("faces", f"{result.report.n_faces:,}"),
        *((title, f"{count:,}") for title, count in result.report.counts.items()),
    ],
)
def repair_file(
    mesh: PathLike,
    output: PathLike,
    options: RepairOptions | None = None,
    *,
    mtl: bool = True,
    progress: Progress = None,
) -> JobResult[RepairReport]:
    """Repair MESH without moving its surface.

    Prints what was changed. Holes, edges of more than two faces and parts that intersect stay;
    texbake check names them.
    """
    from texbake.jobs.mesh_output import read_with_materials, write_result
    from texbake.mesh.repair import repair

    read, materials = read_with_materials(mesh, progress)
    repaired, report = repair(read, options)
    return write_result(repaired, output, materials, report, mtl=mtl)


REPAIR = step_of(
    repair_file,
    does="repairs a mesh without moving its surface",
    format=(FORMAT_OF_MESH, "ply"),
    without=(),
    outputs=lambda settings: {"mesh": f"repaired.{settings['format']}"},
    memory=lambda settings, sizes: PROCESS + 600 * n_faces(sizes, "mesh"),
    figures=lambda result: {
        "faces": result.report.n_faces,
        "repairs": dict(result.report.counts),
        "notes": list(result.warnings),
    },
)


def _size_table(result: JobResult[Mesh]) -> Rows:
    """Return rows about the size of a mesh."""
    mesh, (low, high) = result.report, result.report.bounds
    bounds = " to ".join(f"({', '.join(f'{x:.6g}' for x in end)})" for end in (low, high))
    return [
        ("faces", f"{mesh.n_polygons:,}"),
        ("vertices", f"{mesh.n_vertices:,}"),
        ("size", " x ".join(f"{side:.6g}" for side in high - low)),
        ("bounds", bounds),
    ]


@verb(
    Reads("mesh"),
    Writes("output", "mesh", "The mesh; it may replace MESH.", over="mesh"),
    Options(TransformOptions),
    examples="""
      texbake transform low.obj -o low.obj --scale 0.1
      texbake transform scan.ply -o scan.ply --up z --move 0,0.5,0
      texbake transform inside_out.stl -o turned.stl --flip
    """,
    table=_size_table,
)
def transform_file(
    mesh: PathLike,
    output: PathLike,
    options: TransformOptions | None = None,
    *,
    mtl: bool = True,
    progress: Progress = None,
) -> JobResult[Mesh]:
    """Scale, rotate and move MESH, or flip its faces.

    The mesh is scaled and turned upright, then rotated about the origin, then moved.
    """
    from texbake.jobs.mesh_output import MaterialPartition, read_with_materials, write_result
    from texbake.mesh.transform import transform, transform_matrix

    read, materials = read_with_materials(mesh, progress)
    if options is not None and options.subdivide:
        borders = MaterialPartition.of(read, materials)
        moved, materials = borders.restored(transform(borders.mesh, options), read)
    else:
        moved = transform(read, options)
    if options is not None and materials.rig is not None:
        materials = replace(materials, rig=materials.rig.transformed(transform_matrix(options)))
    return write_result(moved, output, materials, moved, mtl=mtl)


def _transform_figures(result: JobResult[Mesh]) -> dict[str, Any]:
    return {"faces": result.report.n_polygons, "notes": list(result.warnings)}


TRANSFORM = step_of(
    transform_file,
    does="scales, turns and moves a mesh, or changes its format",
    format=(FORMAT_OF_MESH, "ply"),
    without=(),
    outputs=lambda settings: {"mesh": f"transformed.{settings['format']}"},
    memory=lambda settings, sizes: PROCESS + 600 * n_faces(sizes, "mesh"),
    figures=_transform_figures,
)


@verb(
    Reads("mesh", metavar="SOURCE"),
    Writes("output", "mesh", "The file to write; its suffix sets the format.", over="mesh"),
    Options(TransformOptions, "scale", "units", "up", "subdivide", "normals", "angle"),
    examples="""
      texbake convert statue.fbx statue.glb
      texbake convert part.stl -o part.obj --units mm --up z
    """,
    table=_size_table,
)
def convert_file(
    mesh: PathLike, output: PathLike, options: TransformOptions, *, progress: Progress
) -> JobResult[Mesh]:
    """Write the mesh in SOURCE in the format of OUTPUT.

    Keeps texture coordinates, normals, groups and vertex colors where the format has them. A GLB
    file keeps the materials of a glTF, OBJ, FBX or USD file with their images. An OBJ file keeps
    those channels that .mtl files have; that file and the images stand beside it. A warning names
    what is lost.
    """
    return transform_file(mesh, output, options, progress=progress)


def _remesh_table(result: JobResult[RemeshReport]) -> Rows:
    report, distance, diagonal = result.report, result.report.distance, result.report.diagonal
    return [
        ("triangles", f"{report.n_faces_before:,} to {report.n_faces:,}"),
        ("surface", f"{report.surface}: {report.reason}"),
        ("holes filled", f"{report.n_holes_filled:,}"),
        ("separate parts", f"{report.n_components:,}"),
        ("cavities", f"{report.n_cavities_kept:,} kept, {report.n_cavities_filled:,} filled"),
        ("voxel", f"{report.voxel:.4g}"),
        ("gaps closed up to", f"{report.gap:.4g}"),
        (
            "distance to MESH",
            f"RMS {distance.rms:.4g} ± {distance.rms_error:.1g} "
            f"({100 * distance.rms / diagonal:.3f} % of the diagonal), "
            f"greatest {distance.max:.4g} ({100 * distance.max / diagonal:.3f} %)",
        ),
    ]


@verb(
    Reads("mesh"),
    Writes("output", "mesh", "The new mesh; it may replace MESH.", over="mesh"),
    Options(RemeshOptions),
    REPORT,
    THREADS,
    examples="""
      texbake remesh scan.ply -o closed.ply
      texbake remesh generated.glb -o closed.ply --resolution 512 --components largest
      texbake remesh holes.ply -o low.obj --close 5% --faces 5000
      texbake remesh bottle.ply -o hollow.ply --keep-interior
      texbake remesh face.ply -o even.ply --surface open --close 2%
    """,
    table=_remesh_table,
)
def remesh_file(
    mesh: PathLike,
    output: PathLike,
    options: RemeshOptions | None = None,
    *,
    report: PathLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> JobResult[RemeshReport]:
    """Give MESH a new surface, closed or open.

    The closed surface of a body encloses what is seen from outside. MESH may be any triangles:
    doubled and inner walls vanish, overlapping parts become one, and holes and gaps are closed. The
    result is manifold and faces outwards. Its vertices lie on MESH; sheets without thickness get
    some.

    An open surface, such as a range scan, cloth or terrain, stays one sheet with its boundary.
    The result has no texture coordinates.
    """
    from texbake.jobs.outputs import JobResult, present_paths
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.mesh.remesh import remesh_with_report

    read = read_mesh(mesh, progress=progress)
    wrapped, figures = remesh_with_report(read, options, threads=threads, progress=progress)
    write_mesh(wrapped, output)
    return JobResult(files=present_paths(output), report=figures, warnings=figures.notes)


def _remesh_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a mesh that fills a cube, whose surface is folded: its voxels and the net."""
    side = settings["resolution"] + 32
    return int(PROCESS + 300 * n_faces(sizes, "mesh") + 5 * side**3 + 300 * 20 * side**2)


REMESH = step_of(
    remesh_file,
    does="wraps a mesh in a closed surface",
    format=(FORMAT_OF_MESH, "ply"),
    without=("n_faces", "quality"),
    outputs=lambda settings: {"mesh": f"remeshed.{settings['format']}"},
    memory=_remesh_memory,
    figures=lambda result: {
        "faces": result.report.n_faces,
        "components": result.report.n_components,
        "notes": list(result.warnings),
    },
    revision=2,
)


@verb(
    Reads("high"),
    Reads("low"),
    Writes("output", "mesh", "The cage."),
    Extra(
        "--margin",
        "Distance in model units that is added everywhere.  "
        "[default: 0.0001 of the size of both meshes]",
        type=float,
        metavar="LENGTH",
    ),
    THREADS,
    examples="""
      texbake cage scan.ply low.obj -o cage.obj
      texbake cage scan.ply low.obj -o cage.ply --margin 0.01
    """,
)
def cage_file(
    high: PathLike,
    low: PathLike,
    output: PathLike,
    *,
    margin: float | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> JobResult[Cage]:
    """Fit a cage around HIGH, starting from LOW.

    The cage has the faces and texture coordinates of LOW, and no part of HIGH lies outside it. It
    is as tight as possible: no vertex could move farther in on its own. Use it with bake --cage,
    or in any other program that takes cages.
    """
    from texbake.jobs.fit import check_fit, diagnose_opposite_sides
    from texbake.jobs.outputs import JobResult, present_paths
    from texbake.mesh.files import read_mesh, write_mesh

    high_mesh, low_mesh = read_mesh(high, progress=progress), read_mesh(low, progress=progress)
    check_fit(high_mesh, low_mesh, threads=threads)
    cage = _fit_cage(high_mesh, low_mesh, margin, threads)
    write_mesh(cage.mesh, output)
    inside_out = diagnose_opposite_sides(high_mesh, low_mesh, orientation="auto", threads=threads)
    return JobResult(
        files=present_paths(output), report=cage, warnings=(*inside_out, *cage.warnings)
    )


def _fit_cage(high: Mesh, low: Mesh, margin: float | None, threads: int | None) -> Cage:
    """Fit a cage, object by object if their names pair up."""
    import numpy as np

    from texbake.baking.cage import Cage, fit_cage
    from texbake.baking.parts.high_parts import HighMeshes, match_objects
    from texbake.baking.parts.matching import PartsOptions
    from texbake.mesh.compose import excerpt

    paired = match_objects([high], [low], PartsOptions())
    if paired is None:
        return fit_cage(high, low, margin=margin, threads=threads)
    matching, highs, lows = paired
    high_meshes = HighMeshes([high])
    positions, distances = low.positions.copy(), np.zeros(low.n_vertices)
    cages = []
    for match in matching.matches:
        chosen = lows[match.low].faces_of(low)
        source, _ = high_meshes.joined([highs[i] for i in match.highs])
        cage = fit_cage(source, excerpt(low, chosen), margin=margin, threads=threads)
        rows = np.unique(low.faces[chosen])
        positions[rows], distances[rows] = cage.mesh.positions, cage.distances
        cages.append(cage)
    mesh = low.replace(
        positions=positions,
        normals=None,
        normal_faces=None,
        tangents=None,
        name=f"cage of {low.name}",
    )
    return Cage(
        mesh,
        distances,
        sum(cage.n_points for cage in cages),
        sum(cage.n_beside for cage in cages),
        sum(cage.n_uncertain for cage in cages),
        max(cage.greatest_outside for cage in cages),
        sum(cage.n_still for cage in cages),
    )
