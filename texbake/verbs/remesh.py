"""`remesh`: wrap any triangles in a closed surface, or remesh open ones as sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.memory import PROCESS
from texbake.files import PathLike
from texbake.mesh.options import RemeshOptions
from texbake.verbs.step import FORMAT_OF_MESH, Settings, Sizes, n_faces, step_of
from texbake.verbs.verb import REPORT, THREADS, Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.remesh import RemeshReport
    from texbake.progress import ProgressSink


def _table(done: JobResult[RemeshReport]) -> Rows:
    report, distance, diagonal = done.report, done.report.distance, done.report.diagonal
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
            f"RMS {distance.rms:.4g} ({100 * distance.rms / diagonal:.3f} % of the diagonal), "
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
    table=_table,
)
def remesh_file(
    mesh: PathLike,
    output: PathLike,
    options: RemeshOptions | None = None,
    *,
    report: PathLike | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
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


def _memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a mesh that fills a cube, whose surface is folded: its voxels and the net."""
    side = settings["resolution"] + 32
    return int(PROCESS + 300 * n_faces(sizes, "mesh") + 5 * side**3 + 300 * 20 * side**2)


STEP = step_of(
    remesh_file,
    does="wraps a mesh in a closed surface",
    format=(FORMAT_OF_MESH, "ply"),
    without=("n_faces", "quality"),
    outputs=lambda settings: {"mesh": f"remeshed.{settings['format']}"},
    memory=_memory,
    figures=lambda done: {
        "faces": done.report.n_faces,
        "components": done.report.n_components,
        "notes": list(done.warnings),
    },
    revision=2,
)
