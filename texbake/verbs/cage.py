"""`cage`: create a cage that fits the high-poly and the low-poly mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.files import PathLike
from texbake.verbs.verb import THREADS, Extra, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.baking.cage import Cage
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import Mesh
    from texbake.progress import ProgressSink


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
    progress: ProgressSink | None = None,
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
    cage = _fitted(high_mesh, low_mesh, margin, threads)
    write_mesh(cage.mesh, output)
    inside_out = diagnose_opposite_sides(high_mesh, low_mesh, orientation="auto", threads=threads)
    return JobResult(
        files=present_paths(output), report=cage, warnings=(*inside_out, *cage.warnings)
    )


def _fitted(high: Mesh, low: Mesh, margin: float | None, threads: int | None) -> Cage:
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
