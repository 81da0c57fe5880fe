"""The overview of a build: all assets in one table that sorts and filters at once.

The table is plain HTML, so that it can be searched, printed and read without a script, which only
sorts and filters its rows.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np

from texbake.files import PathLike
from texbake.pages.pictures import data_uri, picture_codes
from texbake.pages.sections import command_box, section, tiles
from texbake.pages.shell import asset, page_html, write_page
from texbake.pages.words import duration, memory, number
from texbake.texture.image import FloatImage

STATUSES = ("built", "kept", "failed", "skipped")
THUMBNAIL_PX = 96
# Bytes of all thumbnails of a page together; beyond them assets have none, the good ones first.
MOST_THUMBNAIL_BYTES = 12_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class BuildRow:
    """What the overview tells of one asset; None where it is not known.

    Attributes
    ----------
    name : str
    status : str
        `built`, `kept` (nothing had changed), `failed` or `skipped`.
    message : str
        Why it failed, or what to look at, in a sentence.
    page : str or None
        Its own page, as a path relative to the overview.
    thumbnail : bytes or None
        As `thumbnail` makes it.
    error_deg : float or None
        Mean angle between the normals of the dense mesh and of the light one with its maps.
    miss_percent : float or None
        Missed texels, in percent of the covered ones.
    seconds : float or None
        What its steps took, those that were kept left out.
    n_faces : int or None
        Triangles of the light mesh.
    n_bytes : int or None
        Of all files made.
    """

    name: str
    status: str = "built"
    message: str = ""
    page: str | None = None
    thumbnail: bytes | None = None
    error_deg: float | None = None
    miss_percent: float | None = None
    seconds: float | None = None
    n_faces: int | None = None
    n_bytes: int | None = None


def thumbnail(picture: FloatImage | PathLike) -> bytes:
    """Return a picture of an asset as the few bytes of a small JPEG file.

    Parameters
    ----------
    picture : (H, W, 3 or 4) float32, or path
        Linear light, or an image file with colors. It is cut to a square about its middle.
    """
    from PIL import Image

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
    """Write the overview of a build: one file, which needs no network.

    Parameters
    ----------
    path
        Replaced as a whole.
    rows
        In the order in which the table shows them at first.
    title
        Name of the pipeline.
    command
        What made it, to paste; "" where there was none.
    seconds
        Of the whole build, by the clock.

    Raises
    ------
    FileError
        It cannot be written.
    """
    rows = list(rows)
    shown = _with_thumbnails(rows)
    lines = "".join(_line(row, row_has) for row, row_has in zip(rows, shown, strict=True))
    count = f"{len(rows):,} asset{'' if len(rows) == 1 else 's'}"
    body = (
        f"<header><h1>{escape(title)}</h1>\n"
        f'<p class="faint">{count}{_withheld(rows, shown)}</p>\n{tiles(_tiles(rows, seconds))}'
        f"</header>\n{_TABLE.format(heads=_heads(), lines=lines, orders=_orders())}"
    )
    if command:
        body += section(
            "Again", command_box(command), name="again", about="The command that made this page."
        )
    styles = [asset("controls.css"), asset("build.css")]
    scripts = [asset("page.js"), asset("build.js")]
    write_page(path, page_html(title, body, styles=styles, scripts=scripts))


# Name of a column, its heading, and whether the greatest comes first.
_COLUMNS = (
    ("name", "Asset", False),
    ("status", "Status", True),
    ("error", "Error", True),
    ("misses", "Missed", True),
    ("time", "Time", True),
    ("faces", "Triangles", True),
    ("size", "Size", True),
)
# Failures are what one looks for first.
_RANKS = {"failed": 3, "skipped": 2, "built": 1, "kept": 0}


def _heads() -> str:
    return "".join(
        f'<th scope="col" class="{name}"><button type="button" data-column="{name}" '
        f'data-first="{"down" if falls else "up"}">{label}</button></th>'
        for name, label, falls in _COLUMNS
    )


def _orders() -> str:
    return "".join(
        f'<option value="{name}">{label.lower()}</option>' for name, label, _ in _COLUMNS
    )


def _line(row: BuildRow, has_picture: bool) -> str:
    picture = ""
    if has_picture and row.thumbnail is not None:
        uri = data_uri(row.thumbnail, "image/jpeg")
        picture = f'<img src="{uri}" alt="" width="56" height="56" loading="lazy" decoding="async">'
    name = escape(row.name)
    if row.page is not None:
        name = f'<a href="{escape(quote(Path(row.page).as_posix()))}">{name}</a>'
    status = row.status if row.status in STATUSES else "failed"
    told = f'<p class="message">{escape(row.message)}</p>' if row.message else ""
    cells = (
        _cell("error", "Error", row.error_deg, lambda x: f"{x:.2f}°"),
        _cell("misses", "Missed", row.miss_percent, lambda x: f"{number(x)} %"),
        _cell("time", "Time", row.seconds, duration),
        _cell("faces", "Triangles", row.n_faces, lambda x: f"{int(x):,}"),
        _cell("size", "Size", row.n_bytes, lambda x: memory(int(x))),
    )
    return (
        f'<tr class="{status}"><td class="name" data-key="{escape(row.name.casefold())}">'
        f'<div class="named">{picture or "<i></i>"}<div><b>{name}</b>{told}</div></div></td>'
        f'<td class="status" data-key="{_RANKS[status]}"><span>{status}</span></td>'
        f"{''.join(cells)}</tr>\n"
    )


def _cell(name: str, label: str, value: float | None, told: Callable[[float], str]) -> str:
    if value is None or not np.isfinite(value):
        return f'<td class="{name}" data-label="{label}">–</td>'
    return f'<td class="{name}" data-label="{label}" data-key="{value:.9g}">{told(value)}</td>'


def _with_thumbnails(rows: Sequence[BuildRow]) -> list[bool]:
    """Which rows get their thumbnails: the worst first, as far as the bytes reach."""
    worst_first = sorted(
        range(len(rows)),
        key=lambda k: (-_RANKS.get(rows[k].status, 3), -(rows[k].error_deg or 0.0), k),
    )
    shown, room = [False] * len(rows), MOST_THUMBNAIL_BYTES
    for k in worst_first:
        size = len(rows[k].thumbnail or b"")
        shown[k] = 0 < size <= room
        room -= size
    return shown


def _withheld(rows: Sequence[BuildRow], shown: Sequence[bool]) -> str:
    n_left_out = sum(row.thumbnail is not None for row in rows) - sum(shown)
    if n_left_out <= 0:
        return "."
    return f"; the pictures of the best {n_left_out:,} are left out to keep this page small."


def _tiles(rows: Sequence[BuildRow], seconds: float | None) -> list[tuple[str, str]]:
    counts = [(status, sum(row.status == status for row in rows)) for status in STATUSES]
    found = [(status, f"{n:,}") for status, n in counts if n or status in ("built", "failed")]
    errors = [row.error_deg for row in rows if row.error_deg is not None]
    misses = [row.miss_percent for row in rows if row.miss_percent is not None]
    if errors:
        found += [("median error", f"{float(np.median(errors)):.2f}°")]
        found += [("greatest error", f"{max(errors):.2f}°")]
    if misses:
        found += [("most missed", f"{number(max(misses))} %")]
    if seconds is not None:
        found += [("time", duration(seconds))]
    return found


_TABLE = """<section id="assets">
<h2>Assets</h2>
<div class="controls" role="search">
<label>Find <input type="search" name="find" placeholder="name or message"></label>
<label>Show <select name="shown"><option value="">all</option><option>built</option>\
<option>kept</option><option>failed</option><option>skipped</option></select></label>
<label class="order">Sort by <select name="order"><option value="">as built</option>{orders}\
</select></label>
<output class="count"></output>
</div>
<table>
<thead><tr>{heads}</tr></thead>
<tbody>
{lines}</tbody>
</table>
</section>
"""
