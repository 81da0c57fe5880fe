"""The demo: the whole job on an orange with thousands of pores, made by code."""

from __future__ import annotations

from dataclasses import replace

from texbake.files import PathLike, check_folder, make_folder
from texbake.jobs.options import DEMO_FOLDER, DemoOptions
from texbake.jobs.run import RunResult, run
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import orange
from texbake.progress import ProgressSink, Stages


def demo(
    folder: PathLike = DEMO_FOLDER,
    options: DemoOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> RunResult:
    """Make an orange as a high-poly mesh, and do the whole job on it.

    Parameters
    ----------
    folder
        For the files; made if it is missing. The high-poly mesh is written as well, as
        `orange_high.ply`, the file `high` of the result.
    options
        None for the defaults.
    progress
        Receives the stages.

    Raises
    ------
    FileError
        The folder cannot be made or written to.
    """
    options = options or DemoOptions()
    check_folder(folder)
    high_file = make_folder(folder) / "orange_high.ply"
    stages = Stages(progress)
    with stages.stage("make the orange"):
        high = orange(options.triangles)
        write_mesh(high, high_file)
    result = run(high, folder, options.run_options(), progress=progress)
    return replace(
        result,
        files={"high": high_file, **result.files},
        stages=[*stages.records, *result.stages],
    )
