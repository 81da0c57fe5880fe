"""The study of files: what each setting costs and gains, on a pair of meshes and on a scene."""

from __future__ import annotations

from texbake.errors import OptionError
from texbake.files import PathLike, check_folder
from texbake.jobs.outputs import JobResult
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.pages.page import duration
from texbake.progress import ProgressSink
from texbake.rendering.scene.read import read_scene
from texbake.study.findings import amount
from texbake.study.options import StudyOptions
from texbake.study.plots import check_matplotlib
from texbake.study.result import StudyResult
from texbake.study.study import run_study
from texbake.study.write import write_study


def study_files(
    folder: PathLike,
    options: StudyOptions | None = None,
    *,
    high: PathLike | None = None,
    low: PathLike | None = None,
    scene: PathLike | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[StudyResult]:
    """Measure what each setting gains and costs, and write pages, plots and figures."""
    check_folder(folder)
    check_matplotlib()
    result = run_study(
        *read_pair("study", high, low, progress=progress),
        scene=None if scene is None else read_scene(scene, progress=progress),
        options=options or StudyOptions(),
        progress=progress,
    )
    return JobResult(
        files=tuple(write_study(result, folder, progress=progress)),
        report=result,
        warnings=tuple(
            f"study {name}: left out: {reason}" for name, reason in result.skipped.items()
        ),
    )


def read_pair(
    verb: str, high: PathLike | None, low: PathLike | None, *, progress: ProgressSink | None
) -> tuple[Mesh, Mesh] | tuple[None, None]:
    """Read the pair of meshes that may be given, or return two Nones."""
    if high is None and low is None:
        return None, None
    if high is None or low is None:
        raise OptionError(
            f"{verb}: a pair is a high-poly and a low-poly mesh; give both, or neither"
        )
    return read_mesh(high, progress=progress), read_mesh(low, progress=progress)


def study_rows(result: StudyResult) -> list[tuple[str, str, str, str]]:
    """Return rows of a heading and of each knob's best setting: its name, error and time."""
    rows = [("knob", "pays up to", "error", "time")]
    for item in result.knobs:
        for best in item.knees:
            kept = item.measurements[best]
            error = amount(kept.error, item.knob.unit)
            rows.append((item.knob.name, kept.setting.label, error, duration(kept.median)))
    return rows
