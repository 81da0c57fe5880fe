"""How closely a low-poly mesh with its maps resembles the high-poly mesh: figures and pages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from texbake.files import PathLike
from texbake.jobs.outputs import JobResult
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.progress import Progress
from texbake.rendering.closeness import Closeness
from texbake.rendering.compare import Comparison, compare
from texbake.rendering.options import RenderOptions

# Differences below which nobody sees which of two pictures is closer: in degrees of the mean of all
# normals, in dB of PSNR, where that is below SAME_DB, and as a share of the pixels of the mesh.
VISIBLE_DEG = 0.1
VISIBLE_DB = 0.5
SAME_DB = 40.0
VISIBLE_OUTLINE = 0.01


def page_file(
    high: PathLike,
    low: PathLike,
    html: PathLike,
    options: RenderOptions | None = None,
    *,
    name: str,
    maps: Mapping[str, PathLike],
    misses: PathLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> JobResult[Comparison | None]:
    """Write a page of an asset: both meshes, the maps, and how closely they match."""
    options = options or RenderOptions()
    high_mesh, low_mesh = (read_mesh(path, progress=progress) for path in (high, low))
    high_mesh = high_mesh.replace(name="its high-poly mesh")
    low_mesh = low_mesh.replace(name=name)
    comparison = None
    if "normal" in maps:
        comparison = compare(
            high_mesh,
            low_mesh,
            normal_map=maps["normal"],
            options=options,
            threads=threads,
            progress=progress,
        )
    write_comparison_page(
        html, high_mesh, low_mesh, comparison, files=maps, misses=misses, picture=options
    )
    return JobResult(files=(Path(html),), report=comparison)


def write_comparison_page(
    html: PathLike, high: Mesh, low: Mesh, comparison: Comparison | None, **more: Any
) -> None:
    """Write a page of two meshes, maps and their match, with `more` of `AssetPage`."""
    from texbake.pages.asset_page import AssetPage, write_asset_page

    figures = [] if comparison is None else comparison.table()
    page = AssetPage(high=high, low=low, comparison=comparison, figures=figures, **more)
    write_asset_page(html, page)


def comparison_warnings(comparison: Comparison) -> list[str]:
    """Return a sentence for each use of the maps that is seen to be further off than without."""
    return [
        f"{label} the asset is further from the high-poly mesh than without maps: "
        f"{', '.join(worse)}; see the picture, and `texbake check` for the reason"
        for label, closeness in comparison.uses()
        if (worse := _worse(closeness, comparison.bare))
    ]


def _worse(closeness: Closeness, bare: Closeness) -> list[str]:
    """Return the figures that are seen to be worse than those of the mesh without maps."""
    found = []
    if closeness.mean_deg > bare.mean_deg + VISIBLE_DEG:
        found.append(f"normals off by {closeness.mean_deg:.2f}° and not {bare.mean_deg:.2f}°")
    if closeness.psnr_db < min(bare.psnr_db, SAME_DB) - VISIBLE_DB:
        without = "infinite" if math.isinf(bare.psnr_db) else f"{bare.psnr_db:.1f} dB"
        found.append(f"PSNR {closeness.psnr_db:.1f} dB and not {without}")
    for name, of_low, of_bare in (
        ("outline", closeness.outline_mismatch, bare.outline_mismatch),
        ("depth", closeness.depth_mismatch, bare.depth_mismatch),
    ):
        if of_low > of_bare + VISIBLE_OUTLINE:
            found.append(f"{name} off by {100 * of_low:.1f} % and not {100 * of_bare:.1f} %")
    return found
