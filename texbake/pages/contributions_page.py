"""The page of a preview: the picture, and a thumbnail of what each effect contributes to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texbake.files import PathLike
from texbake.pages.page import asset, page_html, render, write_page
from texbake.pages.pictures import data_uri, png_of, png_of_codes
from texbake.rendering.contributions import Contribution
from texbake.rendering.resolve import Frame

# Width of a thumbnail in pixels at most, and how much differences are multiplied by at most.
_WIDTH = 240
_MOST = 16


def write_contributions_page(
    path: PathLike, title: str, frame: Frame, contributions: Sequence[Contribution], command: str
) -> None:
    """Write the page of a picture."""
    rows = []
    for item in contributions:
        factor = min(_MOST, 255 // max(item.largest, 1))
        small = _thumbnail(item.difference.astype(np.uint16) * factor)
        rows.append(
            {
                "name": item.name,
                "pixels": item.pixels,
                "percent": 100.0 * item.share,
                "largest": item.largest,
                "milliseconds": item.milliseconds,
                "kilobytes": item.n_bytes / 1000.0,
                "factor": factor,
                "picture": data_uri(png_of_codes(small, optimize=True)),
            }
        )
    useless = [row["name"] for row in rows if not row["pixels"]]
    body = render(
        "contributions.html",
        title=title,
        tiles=[
            ("picture", f"{frame.width} × {frame.height}"),
            ("effects", str(len(rows))),
            ("changed nothing", ", ".join(map(str, useless)) or "none"),
        ],
        command=command,
        picture=data_uri(png_of(frame.color)),
        width=frame.width,
        height=frame.height,
        rows=rows,
    )
    write_page(
        path,
        page_html(
            title,
            body,
            styles=[asset("controls.css"), asset("asset.css")],
            scripts=[asset("page.js")],
        ),
    )


def _thumbnail(codes: np.ndarray) -> np.ndarray:
    """Shrink a picture to the largest difference of each block of pixels."""
    step = max(1, -(-codes.shape[1] // _WIDTH))
    height, width = (-(-side // step) for side in codes.shape[:2])
    padded = np.zeros((height * step, width * step, 3), np.uint8)
    padded[: codes.shape[0], : codes.shape[1]] = np.minimum(codes, 255)
    return np.ascontiguousarray(padded.reshape(height, step, width, step, 3).max(axis=(1, 3)))
