"""The overview of a build: all assets in a table that can be sorted and filtered.

The table is plain HTML, which can be searched, printed and read without scripts. The script only
sorts and filters its rows.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from texbake.errors import require_library
from texbake.files import PathLike
from texbake.pages.page import asset, duration, number, page_html, render, write_page
from texbake.pages.pictures import data_uri, picture_codes
from texbake.records import dataclass
from texbake.texture.image import FloatImage

STATUSES = ("built", "kept", "failed", "skipped")
THUMBNAIL_PX = 96
# Limit on the bytes of all thumbnails of a page; beyond it, the best assets have no thumbnails.
MOST_THUMBNAIL_BYTES = 12_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class BuildRow:
    """One asset in the overview. Unknown values are None."""

    name: str
    status: str = "built"  # `built`, `kept` (nothing had changed), `failed` or `skipped`
    message: str = ""  # why the asset failed, or what needs attention, in a sentence
    page: str | None = None  # page of the asset, as a path relative to the overview
    thumbnail: bytes | None = None  # JPEG file from `thumbnail`
    # Mean angle between the normals of the high-poly mesh and of the low-poly mesh with its maps
    error_deg: float | None = None
    miss_percent: float | None = None  # missed texels, as a percentage of the covered texels
    seconds: float | None = None  # time of the steps that ran
    n_faces: int | None = None  # triangles of the low-poly mesh
    n_bytes: int | None = None  # size of all output files


def thumbnail(picture: FloatImage | PathLike) -> bytes:
    """Small, square JPEG file of a linear picture (H, W, 3 or 4), or of a color image file."""
    Image = require_library("PIL.Image", "pictures of pages")

    if isinstance(picture, np.ndarray):
        codes = picture_codes(picture)
    else:
        from texbake.texture.image import read_image

        codes = picture_codes(read_image(picture, color=True).pixels)
    side = min(codes.shape[:2])
    top, left = (codes.shape[0] - side) // 2, (codes.shape[1] - side) // 2
    square = Image.fromarray(codes[top : top + side, left : left + side])
    small = square.resize((THUMBNAIL_PX, THUMBNAIL_PX), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    small.save(file, "JPEG", quality=80, optimize=True)
    return file.getvalue()


def write_build_page(
    path: PathLike,
    rows: Iterable[BuildRow],
    *,
    title: str = "Build",
    command: str = "",
    seconds: float | None = None,
) -> None:
    """Write the overview of a build, a single file that works offline."""
    rows = list(rows)
    shown = _with_thumbnails(rows)
    body = render(
        "build.html",
        title=title,
        rows=[
            (
                row,
                quote(Path(row.page).as_posix()) if row.page else "",
                data_uri(row.thumbnail or b"", "image/jpeg") if has else "",
            )
            for row, has in zip(rows, shown, strict=True)
        ],
        withheld=sum(row.thumbnail is not None for row in rows) - sum(shown),
        tiles=_tiles(rows, seconds),
        columns=_COLUMNS,
        ranks=_RANKS,
        command=command,
    )
    styles = [asset("controls.css"), asset("build.css")]
    scripts = [asset("page.js"), asset("build.js")]
    write_page(path, page_html(title, body, styles=styles, scripts=scripts))


# Name and heading of each column, and whether its greatest values come first.
_COLUMNS = (
    ("name", "Asset", False),
    ("status", "Status", True),
    ("error", "Error", True),
    ("misses", "Missed", True),
    ("time", "Time", True),
    ("faces", "Triangles", True),
    ("size", "Size", True),
)
# Failures come first when the table is sorted by status.
_RANKS = {"failed": 3, "skipped": 2, "built": 1, "kept": 0}


def _with_thumbnails(rows: Sequence[BuildRow]) -> list[bool]:
    """Return which rows show their thumbnails: the worst assets, up to the limit in bytes."""
    worst_first = sorted(
        range(len(rows)), key=lambda k: (-_RANKS[rows[k].status], -(rows[k].error_deg or 0.0), k)
    )
    shown, room = [False] * len(rows), MOST_THUMBNAIL_BYTES
    for k in worst_first:
        size = len(rows[k].thumbnail or b"")
        shown[k] = 0 < size <= room
        room -= size
    return shown


def _tiles(rows: Sequence[BuildRow], seconds: float | None) -> list[tuple[str, str]]:
    counts = [(status, sum(row.status == status for row in rows)) for status in STATUSES]
    shown = [(status, f"{n:,}") for status, n in counts if n or status in ("built", "failed")]
    errors = [row.error_deg for row in rows if row.error_deg is not None]
    misses = [row.miss_percent for row in rows if row.miss_percent is not None]
    if errors:
        shown += [("median error", f"{float(np.median(errors)):.2f}°")]
        shown += [("greatest error", f"{max(errors):.2f}°")]
    if misses:
        shown += [("most missed", f"{number(max(misses))} %")]
    if seconds is not None:
        shown += [("time", duration(seconds))]
    return shown
