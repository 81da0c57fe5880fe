"""Crops of a study: as files for the page, and all on one contact sheet."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt

from texbake.pages.pictures import picture_codes
from texbake.pages.words import duration
from texbake.study.result import KnobResult, StudyResult
from texbake.study.truth.pictures import CROP
from texbake.study.words import amount
from texbake.text import text_coverage

Codes = npt.NDArray[np.uint8]

_GAP, _CAPTION, _TITLE = 10, 36, 34
_PAPER, _INK, _FAINT = 250, 30, 110
_COLUMNS = 8


def contact_sheet(result: StudyResult) -> bytes:
    """PNG of all crops with what they cost and how wrong they are, a band of rows a knob."""
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
    """Title, and below it rows of crops with captions."""
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
    """Words whose ink begins at a place, cut off at the edge of the sheet."""
    coverage = text_coverage(text, size)
    part = sheet[top : top + coverage.shape[0], left : left + coverage.shape[1]]
    share = coverage[: part.shape[0], : part.shape[1], None]
    part[:] = np.rint(part * (1.0 - share) + ink * share).astype(np.uint8)
