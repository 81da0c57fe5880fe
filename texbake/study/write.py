"""The files of a study: figures, plots, the contact sheet and the page."""

from __future__ import annotations

import json
from pathlib import Path

from texbake.files import PathLike, make_folder, replacing
from texbake.progress import ProgressSink, Stages
from texbake.study.page import study_page
from texbake.study.pictures import contact_sheet
from texbake.study.plots import all_plot, check_matplotlib, knob_plot
from texbake.study.result import StudyResult

PAGE, JSON, CSV = "study.html", "study.json", "study.csv"
CONTACT_SHEET, ALL_PLOT = "contact_sheet.png", "all.png"


def write_study(
    result: StudyResult, folder: PathLike, *, progress: ProgressSink | None = None
) -> list[Path]:
    """Write everything that a study measured.

    Parameters
    ----------
    result
        By `study`.
    folder
        Is made if it is not there. It gets `study.html`, which needs none of the others,
        `study.json`, `study.csv`, `contact_sheet.png`, `all.png` and a `NAME.png` for each knob.

    Returns
    -------
    list of Path
        The page first.

    Raises
    ------
    DependencyError
        There is no matplotlib.
    FileError
        A file cannot be written.
    """
    check_matplotlib()
    stages = Stages(progress)
    with stages.stage("draw plots", total=len(result.knobs) + 1, unit="plots") as advance:
        plots = {}
        for item in result.knobs:
            plots[item.knob.name] = knob_plot(item)
            advance(1)
        everything = all_plot(result.knobs)
        advance(1)
    with stages.stage("write"):
        files = {
            PAGE: study_page(result, plots, everything).encode("utf-8"),
            JSON: (json.dumps(result.to_json(), indent=2) + "\n").encode("utf-8"),
            CSV: result.to_csv().encode("utf-8"),
            CONTACT_SHEET: contact_sheet(result),
            ALL_PLOT: everything.png,
            **{f"{name}.png": plot.png for name, plot in plots.items()},
        }
        there = make_folder(folder)
        for name, content in files.items():
            with replacing(there / name) as path:
                path.write_bytes(content)
    return [there / name for name in files]
