"""The files of a study: figures, plots, the page, and all crops on one contact sheet.

The page needs no other file and no network.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike, write_files
from texbake.mapping.layout_view import text_coverage
from texbake.pages.page import duration, page_html, render
from texbake.pages.pictures import data_uri, picture_codes, png_of
from texbake.progress import ProgressSink, Stages
from texbake.study.findings import amount, findings, next_step
from texbake.study.plots import Plot, all_plot, check_matplotlib, knob_plot
from texbake.study.result import KnobResult, Measurement, StudyResult, figure_names
from texbake.study.truth.pictures import CROP

if TYPE_CHECKING:
    from markupsafe import Markup


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


TEMPLATES = Path(__file__).with_name("templates")
PAGE_STYLE = """
.truth { display: inline-block; border-radius: 1rem; padding: .05rem .7rem; font-size: .8rem;
  border: 1px solid var(--line); background: var(--wash); margin-right: .4rem;
  white-space: nowrap; }
ul.findings { margin: .5rem 0 1rem; padding-left: 1.2rem; max-width: 46rem; }
ul.findings li { margin: .25rem 0; }
.wide svg { display: block; width: 100%; height: auto; }
.plot svg { min-width: 30rem; max-width: 46rem; }
.all svg { min-width: 48rem; }
th, td { white-space: nowrap; }
th { white-space: normal; vertical-align: bottom; min-width: 4.5rem; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; position: sticky; left: 0;
  background: var(--paper); }
td.words, th.words { text-align: left; min-width: 9rem; white-space: normal; }
tr.front td:first-child { font-weight: 600; }
tr.kept td { background: var(--kept); }
.range { color: var(--faint); font-size: .8rem; white-space: nowrap; }
.crops { display: grid; grid-template-columns: repeat(auto-fill, minmax(140px, 1fr)); gap: .75rem; }
@media (max-width: 600px) {
  th:first-child, td:first-child { white-space: normal; min-width: 6.5rem; max-width: 8rem; }
  .crops { grid-template-columns: repeat(auto-fill, minmax(104px, 1fr)); }
}
"""

TITLE = "What accuracy costs in time"
_INPUTS = {"high": "high-poly mesh", "low": "low-poly mesh", "scene": "scene"}


def study_page(result: StudyResult, plots: Mapping[str, Plot], everything: Plot) -> str:
    """Return the page as HTML."""
    body = render(
        "study.html",
        folder=TEMPLATES,
        title=TITLE,
        result=result,
        inputs=_INPUTS,
        everything=titled(everything.svg, "All settings of all knobs"),
        plots={
            item.knob.name: titled(plots[item.knob.name].svg, item.knob.title)
            for item in result.knobs
        },
        amount=amount,
        figure_names=figure_names,
        findings=findings,
        next_step=next_step,
        uri_of=crop_uri,
    )
    # The plots are drawn on white.
    return page_html(TITLE, body, styles=[PAGE_STYLE], dark=False)


def crop_uri(item: Measurement) -> str:
    """Return the crop of a setting that has one."""
    assert item.outcome.picture is not None
    return data_uri(png_of(item.outcome.picture))


def titled(svg: str, title: str) -> Markup:
    """SVG of a plot with a name for screen readers."""
    from markupsafe import Markup, escape

    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1))


# The contact sheet

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
