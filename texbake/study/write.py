"""The files of a study: figures, plots, the page, and all crops on one contact sheet."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike, write_files
from texbake.pages.page import duration
from texbake.pages.pictures import picture_codes
from texbake.progress import ProgressSink, Stages
from texbake.study.findings import amount
from texbake.study.page import study_page
from texbake.study.plots import all_plot, check_matplotlib, knob_plot
from texbake.study.result import KnobResult, StudyResult
from texbake.study.truth.pictures import CROP
from texbake.text import text_coverage

PAGE, JSON, CSV = "study.html", "study.json", "study.csv"
CONTACT_SHEET, ALL_PLOT = "contact_sheet.png", "all.png"


def write_study(
    result: StudyResult, folder: PathLike, *, progress: ProgressSink | None = None
) -> list[Path]:
    """Write everything that a study measured."""
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
        return write_files(folder, files)


Codes = npt.NDArray[np.uint8]

_GAP, _CAPTION, _TITLE = 10, 36, 34
_PAPER, _INK, _FAINT = 250, 30, 110
_COLUMNS = 8


def contact_sheet(result: StudyResult) -> bytes:
    """Return a PNG of all crops with their errors and times, knob by knob."""
    from PIL import Image

    bands = [_band(item) for item in result.knobs if _shown(item)]
    if not bands:
        bands = [_blank(_TITLE, CROP)]
    width = max(band.shape[1] for band in bands)
    wide = [
        np.pad(band, ((0, 0), (0, width - band.shape[1]), (0, 0)), constant_values=_PAPER)
        for band in bands
    ]
    file = io.BytesIO()
    Image.fromarray(np.concatenate(wide)).save(file, "PNG", optimize=True)
    return file.getvalue()


def _shown(result: KnobResult) -> list[int]:
    return [i for i, item in enumerate(result.measurements) if item.outcome.picture is not None]


def _band(result: KnobResult) -> Codes:
    """Draw the title of a knob, and below it rows of crops with captions."""
    shown = _shown(result)
    columns = min(_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    cell_height, cell_width = CROP + _CAPTION + _GAP, CROP + _GAP
    sheet = _blank(_TITLE + rows * cell_height + _GAP, max(columns * cell_width + _GAP, 900))
    _write(sheet, result.knob.title, 20, _GAP, 8, _INK)
    for place, i in enumerate(shown):
        item = result.measurements[i]
        assert item.outcome.picture is not None
        top = _TITLE + (place // columns) * cell_height
        left = _GAP + (place % columns) * cell_width
        picture = picture_codes(item.outcome.picture)
        sheet[top : top + len(picture), left : left + picture.shape[1]] = picture
        _write(sheet, item.setting.label, 15, left, top + CROP + 4, _INK)
        words = f"{amount(item.error, result.knob.unit)} in {duration(item.median)}"
        _write(sheet, words, 13, left, top + CROP + 20, _FAINT)
    return sheet


def _blank(height: int, width: int) -> Codes:
    return np.full((height, width, 3), _PAPER, np.uint8)


def _write(sheet: Codes, text: str, size: int, left: int, top: int, ink: int) -> None:
    """Write text that begins at a place and is cut off at the edge of the sheet."""
    coverage = text_coverage(text, size)
    part = sheet[top : top + coverage.shape[0], left : left + coverage.shape[1]]
    share = coverage[: part.shape[0], : part.shape[1], None]
    part[:] = np.rint(part * (1.0 - share) + ink * share).astype(np.uint8)
