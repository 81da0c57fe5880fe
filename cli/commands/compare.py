"""`texbake compare`: how close a light mesh with its maps comes to the dense mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake.jobs.outputs import (
    check_distinct,
    check_page,
    check_picture,
    check_report,
)

from ..html import command_line, html_option
from ..options import (
    image_option,
    mesh_argument,
    picture_options,
    report_option,
    threads_option,
)
from ..terminal import Terminal, table, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake import RenderOptions


@click.command(
    epilog="""
    \b
    Example:
      texbake compare scan.ply low.obj --normal-map normal.png
      texbake compare scan.ply low.obj --normal-map normal.png --view 90,10 -o side.png
    """
)
@mesh_argument("high")
@mesh_argument("low")
@image_option("--normal-map", "Normals of LOW.")
@image_option("--displacement", "Heights of LOW.")
@image_option("--albedo", "Colors of LOW.")
@click.option(
    "-o",
    "--output",
    type=FileOf((".png",)),
    metavar="FILE",
    help="The pictures side by side.  [default: LOW's name and _compare.png, in this folder]",
)
@picture_options
@report_option
@html_option
@threads_option
@terminal_options
def compare(
    high: Path,
    low: Path,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    output: Path | None,
    picture: RenderOptions,
    report: Path | None,
    html: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Tell how close LOW with its maps comes to HIGH.

    Prints the angles between the shading normals that pixels see, from six sides, and PSNR and SSIM
    of the pictures, beside those of bare LOW; writes HIGH, bare LOW, LOW with its maps and their
    difference side by side.
    """
    output = output or Path(f"{low.stem}_compare.png")
    check_distinct([output, report, html], [high, low, normal_map, displacement, albedo])
    check_picture(output)
    check_report(report)
    check_page(html)
    import texbake
    from texbake.jobs.comparison import comparison_report, comparison_table
    from texbake.jobs.outputs import write_report
    from texbake.pages.asset_page import AssetPage, write_asset_page

    with terminal.progress() as progress:
        meshes = [texbake.read_mesh(path, progress=progress) for path in (high, low)]
        comparison = texbake.compare(
            *meshes,
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=picture,
            threads=threads,
            progress=progress,
        )
        texbake.write_image(comparison.side_by_side(), output, color=True, threads=threads)
        if report is not None:
            write_report(report, comparison_report(comparison))
        if html is not None:
            maps = {"normal": normal_map, "displacement": displacement, "albedo": albedo}
            write_asset_page(
                html,
                AssetPage(
                    high=meshes[0],
                    low=meshes[1],
                    files={name: path for name, path in maps.items() if path is not None},
                    comparison=comparison,
                    figures=comparison_table(comparison),
                    command=command_line(),
                    picture=picture,
                ),
            )
    table(comparison_table(comparison))
    terminal.wrote(path for path in (output, report, html) if path is not None)
