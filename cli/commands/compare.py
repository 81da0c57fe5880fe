"""`texbake compare`: how close a light mesh with its maps comes to the dense mesh."""

from __future__ import annotations

from pathlib import Path

import click

from texbake.render.options import UPS, RenderOptions

from ..options import (
    choice_option,
    image_option,
    mesh_argument,
    picture_size_option,
    report_option,
    threads_option,
    view_option,
)
from ..outputs import Outputs
from ..terminal import Terminal, table, terminal_options
from ..types import FileOf


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
    help="The pictures side by side.  [default: LOW's name with _compare.png, in this folder]",
)
@picture_size_option
@view_option
@choice_option("--up", UPS, RenderOptions.up, "Axis of the world that is up in the pictures.")
@report_option
@threads_option
@terminal_options
def compare(
    high: Path,
    low: Path,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    output: Path | None,
    size: tuple[int, int],
    view: tuple[float, ...],
    up: str,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Render HIGH, bare LOW and LOW with its maps, and tell how far they are apart.

    Prints the angles between their shading normals from six sides, and PSNR and SSIM of the
    pictures; writes the three pictures and the difference side by side.
    """
    options = RenderOptions(width=size[0], height=size[1], view=view, up=up)  # type: ignore[arg-type]  # the options check its length
    output = output or Path(f"{low.stem}_compare.png")
    Outputs(pictures=[output], reports=[report]).check()
    import texbake
    from texbake.pipeline.report import comparison_report, write_report

    with terminal.progress() as progress:
        comparison = texbake.compare(
            texbake.read_mesh(high, progress=progress),
            texbake.read_mesh(low, progress=progress),
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=options,
            threads=threads,
            progress=progress,
        )
        texbake.write_image(comparison.side_by_side(), output, color=True, threads=threads)
        if report is not None:
            write_report(report, comparison_report(comparison))
    table(closeness_rows(comparison.bare, comparison.mapped))
    terminal.wrote(path for path in (output, report) if path is not None)
