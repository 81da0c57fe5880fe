"""`transform` and `convert`: scale, turn and move a mesh, or change the format of its file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from texbake.baking.memory import PROCESS
from texbake.files import PathLike
from texbake.mesh.options import TransformOptions
from texbake.verbs.step import FORMAT_OF_MESH, n_faces, step_of
from texbake.verbs.verb import Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import Mesh
    from texbake.progress import ProgressSink


def _size_table(done: JobResult[Mesh]) -> Rows:
    """Return rows about the size of a mesh."""
    mesh, (low, high) = done.report, done.report.bounds
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
    progress: ProgressSink | None = None,
) -> JobResult[Mesh]:
    """Scale, rotate and move MESH, or flip its faces.

    The mesh is scaled and turned upright, then rotated about the origin, then moved.
    """
    from texbake.jobs.mesh_output import MaterialPartition, read_with_materials, write_result
    from texbake.mesh.transform import transform

    read, materials = read_with_materials(mesh, progress)
    if options is not None and options.subdivide:
        borders = MaterialPartition.of(read, materials)
        moved, materials = borders.restored(transform(borders.mesh, options), read)
    else:
        moved = transform(read, options)
    return write_result(moved, output, materials, moved, mtl=mtl)


def _figures(done: JobResult[Mesh]) -> dict[str, Any]:
    return {"faces": done.report.n_polygons, "notes": list(done.warnings)}


TRANSFORM = step_of(
    transform_file,
    does="scales, turns and moves a mesh, or changes its format",
    format=(FORMAT_OF_MESH, "ply"),
    without=(),
    outputs=lambda settings: {"mesh": f"transformed.{settings['format']}"},
    memory=lambda settings, sizes: PROCESS + 600 * n_faces(sizes, "mesh"),
    figures=_figures,
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
    mesh: PathLike, output: PathLike, options: TransformOptions, *, progress: ProgressSink | None
) -> JobResult[Mesh]:
    """Write the mesh in SOURCE in the format of OUTPUT.

    Keeps texture coordinates, normals, groups and vertex colors where the format has them. A GLB
    file keeps the materials of a glTF, OBJ, FBX or USD file with their images. An OBJ file keeps
    those channels that .mtl files have; that file and the images stand beside it. A warning names
    what is lost.
    """
    return transform_file(mesh, output, options, progress=progress)
