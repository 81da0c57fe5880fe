"""The page of one asset: what `bake`, `run` and `compare` write for `--html`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
import numpy.typing as npt

from texbake.baking.result import BakeResult, read_misses
from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    rasterize_uv,
    snap_uvs,
)
from texbake.files import PathLike
from texbake.mesh.mesh import Mesh
from texbake.pages.histogram import histogram_svg
from texbake.pages.map_pictures import MapPicture, baked_pictures, file_pictures
from texbake.pages.sections import (
    Rows,
    command_box,
    comparison_figures,
    figure_table,
    section,
    stage_table,
    tiles,
    warning_list,
)
from texbake.pages.shell import asset, page_html, write_page
from texbake.pages.three_js import three_js
from texbake.pages.viewer import Maps, View
from texbake.pages.words import duration, number
from texbake.progress import StageRecord
from texbake.rendering.compare import Comparison
from texbake.rendering.maps import heights_from
from texbake.rendering.options import RenderOptions

_CODINGS = {"normal": "normal", "displacement": "height", "albedo": "color"}


@dataclass(frozen=True, kw_only=True, eq=False)
class AssetPage:
    """What a page tells of one asset.

    Attributes
    ----------
    high, low : Mesh
        The dense and the light mesh; only one with texture coordinates has maps.
    baked : BakeResult, optional
        The view shows its `normal` map, the histogram its `displacement` map.
    asked : tuple of str
        Names of the maps that were asked for; of others the page says that they are its own.
    files : dict of str to path
        In place of `baked`: maps as files, by `normal`, `displacement` and `albedo`.
    misses : path, optional
        In place of `baked`: its miss map as a file.
    comparison : Comparison, optional
    stages : list of StageRecord
    figures : rows of a label and a figure
        Everything that was measured; a row without a figure is a heading.
    warnings : list of str
    command : str
        What made it, to paste; "" where there was none.
    picture : RenderOptions
        Where the view starts from.
    """

    high: Mesh
    low: Mesh
    baked: BakeResult | None = None
    asked: tuple[str, ...] = ()
    files: Mapping[str, PathLike] = field(default_factory=dict)
    misses: PathLike | None = None
    comparison: Comparison | None = None
    stages: Sequence[StageRecord] = ()
    figures: Rows = ()
    warnings: Sequence[str] = ()
    command: str = ""
    picture: RenderOptions = field(default_factory=RenderOptions)


def write_asset_page(path: PathLike, page: AssetPage) -> None:
    """Write the page of an asset: one file, which needs no network.

    Parameters
    ----------
    path
        Replaced as a whole.
    page
        What it tells. A dense mesh of more triangles than a page holds is made lighter for it, and
        maps that take too many bytes are shown smaller; the page says so.

    Raises
    ------
    DependencyError
        trimesh, from which pages take three.js, is not as it is known here.
    FileError
        A map cannot be read, or the page not written.
    """
    pictures = _pictures(page)
    missed = _missed(page)
    has_misses = missed is not None and bool(missed.any())
    view = View(
        page.high,
        page.low,
        pictures,
        view=page.picture.view,
        up=page.picture.up,
        missed=has_misses,
    )
    data = dict(view.data)
    body = [_header(page), view.html]
    if pictures:
        maps = Maps(pictures, missed)
        data |= maps.data
        body.append(maps.html)
    body += [_errors(page), _distances(page), _measured(page), _command(page)]
    write_page(
        path,
        page_html(
            f"{page.low.name}: baked from {page.high.name}",
            "".join(body),
            styles=[asset("controls.css"), asset("asset.css")],
            scripts=[three_js(), asset("page.js"), asset("view.js"), asset("maps.js")],
            data=data,
        ),
    )


def _pictures(page: AssetPage) -> list[MapPicture]:
    if page.baked is None:
        return file_pictures(page.files, codings=_CODINGS)
    notes = {
        name: "Made for this page; there is no file of it."
        for name in page.baked.maps
        if page.asked and name not in page.asked
    }
    return baked_pictures(page.baked, notes)


def _header(page: AssetPage) -> str:
    return (
        f"<header><h1>{escape(page.low.name)}</h1>\n"
        f'<p class="faint">{page.low.n_faces:,} triangles that stand for the '
        f"{page.high.n_faces:,} of {escape(page.high.name)}.</p>\n{tiles(_tiles(page))}"
        f"{warning_list(page.warnings)}</header>\n"
    )


def _tiles(page: AssetPage) -> list[tuple[str, str]]:
    rows = []
    if page.comparison is not None:
        rows += [
            ("normals off by, mean", f"{page.comparison.mapped.mean_deg:.2f}°"),
            ("without maps", f"{page.comparison.bare.mean_deg:.2f}°"),
        ]
    if page.baked is not None:
        report = page.baked.report
        median = report.distance_percentiles.get(50)
        rows += [
            ("texels missed", f"{report.miss_percent:.3f} %"),
            ("surfaces apart, median", "–" if median is None else number(median)),
        ]
    if page.stages:
        rows.append(("time", duration(sum(stage.seconds for stage in page.stages))))
    return rows


def _errors(page: AssetPage) -> str:
    if page.comparison is None:
        return ""
    return section(
        "Error map",
        comparison_figures(page.comparison),
        name="errors",
        about="All by one camera. The last shows at each pixel the angle between the normals of "
        "the dense mesh and of the light mesh with its maps; gray where they do not see the same "
        "part.",
    )


def _missed(page: AssetPage) -> npt.NDArray[np.bool_] | None:
    """(H, W): texels that are covered and met nothing; None where that is not known."""
    if page.baked is not None:
        return page.baked.missed
    return None if page.misses is None else read_misses(page.misses)


def _heights(page: AssetPage) -> npt.NDArray[np.floating] | None:
    """Heights of the texels that the light mesh covers, those that missed left out."""
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


def _distances(page: AssetPage) -> str:
    values = _heights(page)
    if values is None:
        return ""
    svg = histogram_svg(
        values, title="Histogram of distances", unit="model units; to the right is outwards"
    )
    if not svg:
        return ""
    diagonal = page.low.diagonal or 1.0
    worst = float(np.abs(values).max())
    return section(
        "Distances",
        svg,
        name="distances",
        about="How far the dense surface lies from the light one at each texel, along its smooth "
        f"normals. 99.8 % are drawn; the greatest is {number(worst)}, "
        f"{number(100.0 * worst / diagonal)} % of the diagonal of the light mesh.",
    )


def _measured(page: AssetPage) -> str:
    times = section("Times", stage_table(page.stages), name="times") if page.stages else ""
    told = {stage.name for stage in page.stages} | ({"total"} if page.stages else set())
    figures = [row for row in page.figures if row[0].strip() not in told]
    if not figures:
        return times
    return times + section(
        "Figures", f'<div class="wide">{figure_table(figures)}</div>\n', name="figures"
    )


def _command(page: AssetPage) -> str:
    if not page.command:
        return ""
    return section(
        "Again", command_box(page.command), name="again", about="The command that made this page."
    )
