"""The page of one asset, which `bake`, `run` and `compare` write as their `html` file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from texbake.baking.options import BakeOptions
from texbake.baking.result import BakeResult, read_misses
from texbake.baking.texels import NO_FACE, SampleGrid, rasterize_uv, snap_uvs
from texbake.files import PathLike
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, Mesh
from texbake.metadata import SPACE
from texbake.pages.page import as_json, asset, duration, number, page_html, render, write_page
from texbake.pages.pictures import (
    MapPicture,
    baked_pictures,
    data_uri,
    file_pictures,
    miss_picture,
    picture_codes,
    png_of,
)
from texbake.pages.plots import histogram_svg
from texbake.pages.viewer import CODINGS, angle_colors, view_data
from texbake.progress import Progress, StageRecord
from texbake.records import dataclass
from texbake.rendering.compare import Comparison, compare
from texbake.rendering.maps import heights_from
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import MAX_ANGLE_DEG
from texbake.rendering.render import render as render_mesh
from texbake.texture.image import Image
from texbake.texture.image_files import encode_image

Rows = Sequence[tuple[str, str]]
# Maps that every page needs: normals for the 3D view, heights for the histogram.
PAGE_MAPS = ("normal", "displacement")
_PICTURE_PX = 560
_STILL_QUALITY = 85


if TYPE_CHECKING:
    from markupsafe import Markup


@dataclass(frozen=True, eq=False)
class Plot:
    """A plot with a heading and a sentence or two about it; `svg` is an `svg` element."""

    title: str
    about: str
    svg: Markup


@dataclass(frozen=True, kw_only=True, eq=False)
class AssetPage:
    """Contents of the page of one asset."""

    # high, low: the high-poly and the low-poly mesh. Maps are shown only if the low-poly mesh has
    # texture coordinates.
    high: Mesh
    low: Mesh
    # The 3D view shows its `normal` map, the histogram its `displacement` map
    baked: BakeResult | None = None
    # Names of the requested maps. The page notes that the others were made only for it.
    asked: tuple[str, ...] = ()
    # Map files to show instead of `baked`, by `normal`, `displacement` and `albedo`
    files: Mapping[str, PathLike] = field(default_factory=dict)
    misses: PathLike | None = None  # miss map file to show instead of that of `baked`
    comparison: Comparison | None = None
    stages: Sequence[StageRecord] = ()
    figures: Rows = ()  # all measurements; a row without a figure is a heading
    warnings: Sequence[str] = ()
    command: str = ""  # the command that made the asset, for a shell; "" for none
    # The initial camera of the 3D view
    picture: RenderOptions = field(default_factory=RenderOptions)
    plots: Sequence[Plot] = ()  # more measurements, each in a section of its own


def write_asset_page(path: PathLike, page: AssetPage) -> None:
    """Write the page of an asset, a single file that works offline."""
    pictures = _pictures(page)
    missed = _missed(page)
    has_misses = missed is not None and bool(missed.any())
    data, notes = view_data(page.high, page.low, pictures, page.picture)
    if pictures:
        data["map-settings"] = as_json([picture.settings() for picture in pictures])
    listed = {stage.name for stage in page.stages} | ({"total"} if page.stages else set())
    body = render(
        "asset.html",
        high=page.high,
        low=page.low,
        still=_still(page),
        tiles=_tiles(page),
        warnings=page.warnings,
        pictures=pictures,
        missed=miss_picture(missed) if missed is not None and has_misses else "",
        notes=notes,
        colors=angle_colors(),
        greatest=MAX_ANGLE_DEG,
        stages=page.stages,
        figures=[row for row in page.figures if row[0].strip() not in listed],
        command=page.command,
        plots=page.plots,
        **_comparison(page.comparison),
        **_distances(page),
    )
    html = page_html(
        f"{page.low.name}: baked from {page.high.name}",
        body,
        styles=[asset("controls.css"), asset("asset.css")],
        # three.js r149, unchanged: the last release that is one script and prints no warning. It
        # defines the global `THREE`.
        scripts=[asset("three.min.js"), asset("page.js"), asset("view.js"), asset("maps.js")],
        data=data,
    )
    write_page(path, html)


def write_bake_page(
    path: PathLike,
    high: MeshLike,
    low: MeshLike,
    baked: BakeResult,
    *,
    asked: Sequence[str] | None = None,
    stages: Sequence[StageRecord] | None = None,
    warnings: Sequence[str] | None = None,
    command: str = "",
    up: str = RenderOptions.up,
    progress: Progress = None,
) -> Comparison | None:
    """Write the page of a bake, a single file that works offline; `up`: `y` or `z`."""
    high, low = as_mesh(high), as_mesh(low)
    report = baked.report
    picture = RenderOptions(width=_PICTURE_PX, height=_PICTURE_PX, up=up)
    comparison = None
    if "normal" in baked.maps:
        colors = 0.5 * baked.maps["normal"].values + 0.5
        comparison = compare(
            high,
            low,
            normal_map=Image(colors, {SPACE: report.options.space}),
            options=picture,
            threads=report.options.threads,
            progress=progress,
        )
    page = AssetPage(
        high=high,
        low=low,
        baked=baked,
        asked=tuple(baked.maps if asked is None else asked),
        comparison=comparison,
        stages=report.stages if stages is None else stages,
        figures=report.table(),
        warnings=report.warnings if warnings is None else warnings,
        command=command,
        picture=picture,
    )
    write_asset_page(path, page)
    return comparison


def page_options(options: BakeOptions) -> BakeOptions:
    """Add the maps that a page needs, unless adaptive samples would then change others."""
    if options.is_adaptive or options.time_budget is not None:
        return options
    return replace(options, maps=tuple(dict.fromkeys((*options.maps, *PAGE_MAPS))))


def as_asked(baked: BakeResult, options: BakeOptions) -> BakeResult:
    """Remove the maps that `page_options` added from the result of a bake."""
    maps = {name: made for name, made in baked.maps.items() if name in options.maps}
    return replace(baked, maps=maps, report=replace(baked.report, options=options))


def _pictures(page: AssetPage) -> list[MapPicture]:
    if page.baked is None:
        return file_pictures(page.files, codings=CODINGS)
    notes = {
        name: "Made for this page; there is no file of it."
        for name in page.baked.maps
        if page.asked and name not in page.asked
    }
    return baked_pictures(page.baked.maps, notes)


def _still(page: AssetPage) -> str:
    """Return a picture of the low-poly mesh, as a data URI, for browsers that cannot draw it."""
    if page.comparison is not None:
        frame = page.comparison.mapped_frame
    else:
        small = replace(page.picture, width=_PICTURE_PX, height=_PICTURE_PX, exposure="auto")
        frame = render_mesh(page.low, options=small)
    jpeg = encode_image(picture_codes(frame.color), "jpeg", quality=_STILL_QUALITY)
    return data_uri(jpeg, "image/jpeg")


def _tiles(page: AssetPage) -> list[tuple[str, str]]:
    rows = []
    if page.comparison is not None:
        rows += [
            ("mean error of the normals with maps", f"{page.comparison.mapped.mean_deg:.2f}°"),
            ("without maps", f"{page.comparison.bare.mean_deg:.2f}°"),
        ]
    if page.baked is not None:
        report = page.baked.report
        median = report.distance_percentiles.get(50)
        rows += [
            ("texels missed", f"{report.miss_percent:.3f} %"),
            ("median distance", "–" if median is None else number(median)),
        ]
    if page.stages:
        rows.append(("time", duration(sum(stage.seconds for stage in page.stages))))
    return rows


def _comparison(comparison: Comparison | None) -> dict[str, Any]:
    """Return the pictures of a comparison with names and notes, and the map of its errors."""
    if comparison is None:
        return {"comparison": (), "errors": ""}
    shown = [
        (comparison.high_frame, "High-poly", ""),
        (comparison.bare_frame, "Low-poly", f"mean error {comparison.bare.mean_deg:.2f}°"),
        (comparison.mapped_frame, "Baked", f"mean error {comparison.mapped.mean_deg:.2f}°"),
    ]
    if comparison.displaced is not None and comparison.displaced_frame is not None:
        error = f"mean error {comparison.displaced.mean_deg:.2f}°"
        shown.append((comparison.displaced_frame, "Displaced as well", error))
    return {
        "comparison": [(data_uri(png_of(frame.color)), name, note) for frame, name, note in shown],
        "errors": data_uri(png_of(comparison.difference())),
    }


def _missed(page: AssetPage) -> BoolArray | None:
    """Return the mask (H, W) of covered texels whose rays missed; None if it is unknown."""
    if page.baked is not None:
        return page.baked.missed
    return None if page.misses is None else read_misses(page.misses)


def _heights(page: AssetPage) -> npt.NDArray[np.floating] | None:
    """Return the heights of the texels that the low-poly mesh covers, without misses."""
    if page.baked is not None:
        baked = page.baked.maps.get("displacement")
        return None if baked is None else baked.values[..., 0][baked.has_data]
    if "displacement" not in page.files or page.low.uvs is None:
        return None
    heights = heights_from(page.files["displacement"])[..., 0]
    grid = SampleGrid(heights.shape[1], heights.shape[0], 1)
    owners, _ = rasterize_uv(snap_uvs(page.low, grid), grid, range(grid.height))
    covered = owners != NO_FACE
    missed = _missed(page)
    if missed is not None and missed.shape == covered.shape:
        covered &= ~missed
    return np.asarray(heights[covered])


def _distances(page: AssetPage) -> dict[str, Any]:
    """Return the histogram of distances, and the greatest distance."""
    values = _heights(page)
    svg: Any = ""
    if values is not None:
        svg = histogram_svg(
            values, title="Histogram of distances", unit="model units; outward to the right"
        )
    if values is None or not svg:
        return {"histogram": "", "worst": 0.0, "worst_percent": 0.0}
    worst = float(np.abs(values).max())
    percent = 100.0 * worst / (page.low.diagonal or 1.0)
    return {"histogram": svg, "worst": worst, "worst_percent": percent}
