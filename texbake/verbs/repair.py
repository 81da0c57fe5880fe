"""`repair`: repair a mesh without moving its surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.memory import PROCESS
from texbake.files import PathLike
from texbake.mesh.options import RepairOptions
from texbake.verbs.step import FORMAT_OF_MESH, n_faces, step_of
from texbake.verbs.verb import Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.repair import RepairReport
    from texbake.progress import ProgressSink


@verb(
    Reads("mesh"),
    Writes("output", "mesh", "The repaired mesh; it may replace MESH.", over="mesh"),
    Options(RepairOptions),
    examples="""
      texbake repair scan.ply -o clean.ply
      texbake repair model.obj -o clean.obj --no-winding
    """,
    table=lambda done: [
        ("faces", f"{done.report.n_faces:,}"),
        *((title, f"{count:,}") for title, count in done.report.counts.items()),
    ],
)
def repair_file(
    mesh: PathLike,
    output: PathLike,
    options: RepairOptions | None = None,
    *,
    mtl: bool = True,
    progress: ProgressSink | None = None,
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


STEP = step_of(
    repair_file,
    does="repairs a mesh without moving its surface",
    format=(FORMAT_OF_MESH, "ply"),
    without=(),
    outputs=lambda settings: {"mesh": f"repaired.{settings['format']}"},
    memory=lambda settings, sizes: PROCESS + 600 * n_faces(sizes, "mesh"),
    figures=lambda done: {
        "faces": done.report.n_faces,
        "repairs": dict(done.report.counts),
        "notes": list(done.warnings),
    },
)
