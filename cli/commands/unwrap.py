"""`texbake unwrap`: texture coordinates for a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake.mapping.options import METHODS, UnwrapOptions

from ..options import (
    WRITABLE_MESH_SUFFIXES,
    choice_option,
    mesh_argument,
    number_option,
    output_file,
    picture_option,
    report_option,
    size_option,
)
from ..outputs import check_distinct, check_mesh, check_picture, check_report
from ..terminal import Terminal, terminal_options

if TYPE_CHECKING:
    from texbake import UnwrapReport


@click.command(
    epilog="""
    \b
    Example:
      texbake unwrap low.obj -o low_uv.obj --size 2048 --padding 8
      texbake unwrap low.obj -o low_uv.glb --layout layout.png --report unwrap.json
    """
)
@mesh_argument("mesh")
@output_file("The mesh with texture coordinates.", WRITABLE_MESH_SUFFIXES)
@choice_option(
    "--method", METHODS, UnwrapOptions.method, "atlas: charts of little stretch, side by side."
)
@size_option(UnwrapOptions.size, "Texels of the texture that the coordinates are for.")
@number_option(
    "--padding",
    int,
    UnwrapOptions.padding,
    "PX",
    "Texels that a bake may pad each chart by without meeting another's.",
)
@picture_option("--layout", "Also draw the charts.")
@report_option
@terminal_options
def unwrap(
    mesh: Path,
    output: Path,
    method: str,
    size: int | tuple[int, int],
    padding: int,
    layout: Path | None,
    report: Path | None,
    terminal: Terminal,
) -> None:
    """Give MESH texture coordinates.

    No two faces overlap and none is mirrored. Positions and the order of faces stay as they are.
    """
    options = UnwrapOptions(method=method, size=size, padding=padding)
    check_distinct([output, layout, report])
    check_distinct([layout, report], [mesh])  # the output may replace the mesh
    check_mesh(output)
    check_picture(layout)
    check_report(report)
    import texbake
    from texbake.pipeline.report import write_report

    with terminal.progress() as progress:
        unwrapped, figures = texbake.unwrap_with_report(
            texbake.read_mesh(mesh, progress=progress), options, progress=progress
        )
        texbake.write_mesh(unwrapped, output)
        if layout is not None:
            texbake.write_image(texbake.draw_layout(unwrapped, size), layout, color=True)
        if report is not None:
            write_report(report, figures.to_json())
    terminal.summary(_rows(figures))
    terminal.wrote(path for path in (output, layout, report) if path is not None)


def _rows(report: UnwrapReport) -> list[tuple[str, str]]:
    found = report.distortion
    rows = [
        ("faces", f"{report.n_faces:,}"),
        ("charts", f"{report.n_charts:,}"),
        ("texture filled", f"{100 * report.fill:.1f} %"),
        ("stretch", f"L2 {found.stretch.l2:.3f} (1 at best), greatest {found.stretch.linf:.2f}"),
        (
            "texels a model unit",
            f"{found.texel_density:.4g}, varying by {100 * found.texel_density_variation:.1f} %",
        ),
        ("seams", f"{found.seam_length:.4g} model units"),
    ]
    if report.n_ignored:
        rows.append(("without area", f"{report.n_ignored:,} faces, which get one point each"))
    return rows
