"""Cages for mesh files."""

from __future__ import annotations

from texbake.baking.cage.fit import Cage, fit_cage
from texbake.files import PathLike, appearing_together
from texbake.jobs.fit import check_fit, why_rays_would_miss
from texbake.jobs.outputs import JobResult, check_distinct, check_mesh, given
from texbake.mesh.files import read_mesh, write_mesh
from texbake.progress import ProgressSink


@appearing_together()
def cage_file(
    high: PathLike,
    low: PathLike,
    output: PathLike,
    *,
    margin: float | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[Cage]:
    """Fit a cage around a high-poly mesh file, and write it.

    The high-poly mesh may face either way. A low-poly mesh that is inside out gets a
    warning, because its cage lies on the wrong side.

    Parameters
    ----------
    high, low
        Mesh files.
    output
        The cage: the low-poly mesh with its vertices moved outwards.
    margin, threads
        As for `fit_cage`.
    progress
        Receives the stages.
    """
    check_distinct([output], [high, low])
    check_mesh(output)
    high_mesh, low_mesh = read_mesh(high, progress=progress), read_mesh(low, progress=progress)
    check_fit(high_mesh, low_mesh, threads=threads)
    cage = fit_cage(high_mesh, low_mesh, margin=margin, threads=threads)
    write_mesh(cage.mesh, output)
    inside_out = why_rays_would_miss(high_mesh, low_mesh, orientation="auto", threads=threads)
    return JobResult(files=given(output), report=cage, warnings=(*inside_out, *cage.warnings))
