"""How closely a low-poly mesh with its maps resembles the high-poly mesh, from files to files."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from texbake.files import PathLike, appearing_together
from texbake.jobs.outputs import (
    JobResult,
    check_distinct,
    check_page,
    check_picture,
    check_report,
    present_paths,
    write_report,
)
from texbake.mesh.files import read_mesh
from texbake.progress import ProgressSink
from texbake.rendering.compare import Closeness, Comparison, compare
from texbake.rendering.options import RenderOptions
from texbake.texture.image import write_image

# Differences below which nobody sees which of two pictures is closer: in degrees of the mean of all
# normals, in dB of PSNR, where that is below SAME_DB, and as a share of the pixels of the mesh.
VISIBLE_DEG = 0.1
VISIBLE_DB = 0.5
SAME_DB = 40.0
VISIBLE_OUTLINE = 0.01


@appearing_together()
def compare_files(
    high: PathLike,
    low: PathLike,
    output: PathLike | None = None,
    options: RenderOptions | None = None,
    *,
    normal_map: PathLike | None = None,
    displacement: PathLike | None = None,
    albedo: PathLike | None = None,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[Comparison]:
    """Compare two mesh files from six sides, and write the pictures side by side."""
    output = Path(f"{Path(low).stem}_compare.png" if output is None else output)
    maps = {"normal": normal_map, "displacement": displacement, "albedo": albedo}
    check_distinct([output, report, html], [high, low, *maps.values()])
    check_picture(output)
    check_report(report)
    check_page(html)
    options = options or RenderOptions()
    high_mesh, low_mesh = (read_mesh(path, progress=progress) for path in (high, low))
    comparison = compare(
        high_mesh,
        low_mesh,
        normal_map=normal_map,
        displacement=displacement,
        albedo=albedo,
        options=options,
        threads=threads,
        progress=progress,
    )
    write_image(comparison.side_by_side(), output, color=True, threads=threads)
    if report is not None:
        write_report(report, comparison_report(comparison))
    if html is not None:
        from texbake.pages.asset_page import AssetPage, write_asset_page

        page = AssetPage(
            high=high_mesh,
            low=low_mesh,
            files={name: path for name, path in maps.items() if path is not None},
            comparison=comparison,
            figures=comparison_table(comparison),
            command=command,
            picture=options,
        )
        write_asset_page(html, page)
    return JobResult(files=present_paths(output, report, html), report=comparison)


def page_file(
    high: PathLike,
    low: PathLike,
    html: PathLike,
    options: RenderOptions | None = None,
    *,
    name: str | None = None,
    normal_map: PathLike | None = None,
    displacement: PathLike | None = None,
    albedo: PathLike | None = None,
    misses: PathLike | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[Comparison | None]:
    """Write a page of an asset: both meshes, the maps, and how closely they match."""
    check_page(html)
    options = options or RenderOptions()
    high_mesh, low_mesh = (read_mesh(path, progress=progress) for path in (high, low))
    if name is not None:
        high_mesh = high_mesh.replace(name="its high-poly mesh")
        low_mesh = low_mesh.replace(name=name)
    comparison = None
    if normal_map is not None:
        comparison = compare(
            high_mesh,
            low_mesh,
            normal_map=normal_map,
            options=options,
            threads=threads,
            progress=progress,
        )
    from texbake.pages.asset_page import AssetPage, write_asset_page

    maps = {"normal": normal_map, "displacement": displacement, "albedo": albedo}
    page = AssetPage(
        high=high_mesh,
        low=low_mesh,
        files={kind: path for kind, path in maps.items() if path is not None},
        misses=misses,
        comparison=comparison,
        figures=[] if comparison is None else comparison_table(comparison),
        picture=options,
    )
    write_asset_page(html, page)
    return JobResult(files=present_paths(html), report=comparison)


def comparison_report(comparison: Comparison) -> dict[str, Any]:
    """Return the figures of a comparison, with and without maps, as plain values."""
    displaced = comparison.displaced
    return {
        "mapped": asdict(comparison.mapped),
        "maps": list(comparison.maps),
        **({} if displaced is None else {"displaced": asdict(displaced)}),
        "bare": asdict(comparison.bare),
        "views_deg": [list(view) for view in comparison.views],
    }


def comparison_table(comparison: Comparison) -> list[tuple[str, str]]:
    """Return a row of figures for each use of the maps, starting with that of a GLB file."""
    bare = ("without maps", comparison.bare)
    return [(label, _figures(closeness)) for label, closeness in (*_uses(comparison), bare)]


def comparison_warnings(comparison: Comparison) -> list[str]:
    """Return a sentence for each use of the maps that is seen to be further off than without."""
    return [
        f"{label} the asset is further from the high-poly mesh than without maps: "
        f"{', '.join(worse)}; see the picture, and `texbake check` for the reason"
        for label, closeness in _uses(comparison)
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


def _uses(comparison: Comparison) -> list[tuple[str, Closeness]]:
    """Return each use of the maps with its figures."""
    found = []
    if comparison.maps:
        found.append((f"with its {' and '.join(comparison.maps)}", comparison.mapped))
    if comparison.displaced is not None:
        found.append(("displaced as well", comparison.displaced))
    return found


def _figures(closeness: Closeness) -> str:
    similar = "" if closeness.ssim is None else f"SSIM {closeness.ssim:.3f}, "
    return (
        f"normals {closeness.mean_deg:.2f}° off (median {closeness.median_deg:.2f}°, 95 % below "
        f"{closeness.p95_deg:.2f}°), "
        f"PSNR {closeness.psnr_db:.1f} dB, {similar}"
        f"outline {100 * closeness.outline_mismatch:.2f} % off, "
        f"depth {100 * closeness.depth_mismatch:.2f} %"
    )
