"""The page of a bake, with what it needs beyond the bake itself."""

from __future__ import annotations

from collections.abc import Sequence

from texbake.baking.result import BakeResult
from texbake.files import PathLike
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.metadata import SPACE
from texbake.pages.asset_page import AssetPage, write_asset_page
from texbake.progress import ProgressSink, StageRecord
from texbake.rendering.compare import Comparison, compare
from texbake.rendering.options import RenderOptions
from texbake.texture.image import Image

_PICTURE_PX = 560


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
    progress: ProgressSink | None = None,
) -> Comparison | None:
    """Write the page of a bake; it needs no network.

    Parameters
    ----------
    path
        Replaced as a whole.
    high, low
        As they were baked.
    baked
        With `page_maps.page_options`, so that there are normals for the view and heights for the
        histogram whatever was asked for.
    asked
        Names of the maps that were asked for; of others the page says that they are its own. None
        for all.
    stages, warnings
        None for those of the bake's report.
    command
        What made it, to paste.
    up
        Axis of the world that is up in the pictures: `y` or `z`.
    progress
        Told of the stages of the comparison.

    Returns
    -------
    Comparison or None
        Of the light mesh with its normal map; None where none was baked.

    Raises
    ------
    DependencyError, FileError
        As `write_asset_page` does.
    """
    high, low = as_mesh(high), as_mesh(low)
    report = baked.report
    picture = RenderOptions(width=_PICTURE_PX, height=_PICTURE_PX, up=up)
    comparison = _compared(high, low, baked, picture, progress)
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


def _compared(
    high: Mesh, low: Mesh, baked: BakeResult, picture: RenderOptions, progress: ProgressSink | None
) -> Comparison | None:
    if "normal" not in baked.maps:
        return None
    options = baked.report.options
    colors = 0.5 * baked.maps["normal"].values + 0.5
    return compare(
        high,
        low,
        normal_map=Image(colors, {SPACE: options.space}),
        options=picture,
        threads=options.threads,
        progress=progress,
    )
