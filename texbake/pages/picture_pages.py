"""Pages of pictures: what each effect of a preview contributes, and a model before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texbake.files import PathLike
from texbake.pages.page import asset, page_html, render, write_page
from texbake.pages.pictures import data_uri, png_of, png_of_codes
from texbake.rendering.compare_models import Contribution, ModelComparison, Picture, decibels
from texbake.rendering.resolve import Frame
from texbake.texture.image_files import encode_image

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
        rows.append((item, factor, data_uri(png_of_codes(small, optimize=True))))
    useless = [item.name for item in contributions if not item.pixels]
    body = render(
        "contributions.html",
        title=title,
        tiles=[
            ("picture", f"{frame.width} × {frame.height}"),
            ("effects", str(len(rows))),
            ("changed nothing", ", ".join(useless) or "none"),
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


# Of the pictures on the page: no difference that JPEG makes is seen next to those of the models.
_JPEG_QUALITY = 92


def write_slider_page(
    path: PathLike,
    comparison: ModelComparison,
    *,
    n_bytes: tuple[int, int] | None = None,
    figures: Sequence[tuple[str, str]] = (),
    warnings: Sequence[str] = (),
    command: str = "",
) -> None:
    """Write a page with two versions of a model, a single file that works offline."""
    views = [
        (_jpeg(before), _jpeg(after), decibels(error), i == comparison.worst_view)
        for i, (before, after, error) in enumerate(
            zip(comparison.before, comparison.after, comparison.psnr_db, strict=True)
        )
    ]
    body = render(
        "slider.html",
        names=comparison.names,
        tiles=_tiles(comparison, n_bytes),
        warnings=warnings,
        views=views,
        figures=figures,
        command=command,
    )
    html = page_html(
        f"{comparison.names[1]}: made from {comparison.names[0]}",
        body,
        styles=[asset("controls.css"), asset("asset.css"), asset("slider.css")],
        scripts=[asset("page.js"), asset("slider.js")],
    )
    write_page(path, html)


def _tiles(comparison: ModelComparison, n_bytes: tuple[int, int] | None) -> list[tuple[str, str]]:
    before, after = comparison.n_faces
    rows = [("triangles before", f"{before:,}"), ("triangles after", f"{after:,}")]
    if n_bytes is not None:
        rows += [
            ("size before", f"{n_bytes[0] / 1e6:,.2f} MB"),
            ("size after", f"{n_bytes[1] / 1e6:,.2f} MB"),
            ("of the bytes", f"{100.0 * n_bytes[1] / max(n_bytes[0], 1):.1f} %"),
        ]
    rows.append(("PSNR of all views", decibels(comparison.mean_db)))
    rows.append(("PSNR of the worst view", decibels(comparison.worst_db)))
    return rows


def _jpeg(picture: Picture) -> str:
    return data_uri(encode_image(picture, "jpeg", quality=_JPEG_QUALITY), "image/jpeg")
