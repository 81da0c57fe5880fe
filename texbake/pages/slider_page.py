"""The page of a model and another version of it: pictures over each other, with a slider."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from texbake.files import PathLike
from texbake.pages.page import asset, page_html, render, write_page
from texbake.pages.pictures import data_uri
from texbake.rendering.compare_models import ModelComparison, Picture, decibels
from texbake.texture.image_files import encode_image

# Of the pictures on the page: no difference that JPEG makes is seen next to those of the models.
_JPEG_QUALITY = 92


@dataclass(frozen=True)
class _View:
    """A view on the page: its pictures as data URIs, its PSNR, and whether it is shown first."""

    before: str
    after: str
    error: str
    chosen: bool


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
        _View(_jpeg(before), _jpeg(after), decibels(error), i == comparison.worst_view)
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
