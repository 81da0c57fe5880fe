"""The demo: the whole job on an orange with thousands of pores, made by code."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from texbake.files import PathLike, appearing_together, check_folder, make_folder
from texbake.jobs.options import DEMO_FOLDER, DemoOptions
from texbake.jobs.outputs import check_page
from texbake.jobs.run import RunResult, run, with_page
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import orange
from texbake.progress import ProgressSink, Stages

if TYPE_CHECKING:
    from texbake.pages.asset_page import Plot

_ABOUT_TURNS = (
    "A photograph, a bump map, a normal map and a displacement map of an orange, each on the same "
    "smooth sphere, against pictures of the high-poly orange. The photograph was taken at 0° and "
    "keeps the light of that moment. The bump map and the normal map follow the light and keep the "
    "silhouette of the sphere, which is most of their error. The displacement map follows both."
)


@appearing_together()
def demo(
    folder: PathLike = DEMO_FOLDER,
    options: DemoOptions | None = None,
    *,
    html: PathLike | None = None,
    command: str = "",
    progress: ProgressSink | None = None,
) -> RunResult:
    """Make an orange as a high-poly mesh, and do the whole job on it."""
    options = options or DemoOptions()
    check_folder(folder)
    high_file = make_folder(folder) / "orange_high.ply"
    check_page(html)  # which may be in that folder
    stages = Stages(progress)
    with stages.stage("make the orange"):
        high = orange(options.triangles)
        write_mesh(high, high_file)
    result = run(high, folder, options.run_options(), progress=progress)
    result = replace(
        result,
        files={"high": high_file, **result.files},
        stages=[*stages.records, *result.stages],
    )
    if html is None:
        return result
    return with_page(
        result,
        html,
        options.run_options(),
        command=command,
        plots=[_turns_plot(options.threads, progress)],
    )


def _turns_plot(threads: int | None, progress: ProgressSink | None) -> Plot:
    from texbake.jobs.orange_turns import measure_turns, turns_svg
    from texbake.pages.asset_page import Plot

    return Plot(
        "The light and the viewer turn",
        _ABOUT_TURNS,
        turns_svg(measure_turns(threads=threads, progress=progress)),
    )
