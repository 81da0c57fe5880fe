"""`texbake unwrap`: texture coordinates for meshes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake.errors import OptionError
from texbake.files import check_folder, make_folder
from texbake.jobs.outputs import (
    check_distinct,
    check_mesh,
    check_picture,
    check_report,
)
from texbake.mapping.options import UnwrapOptions

from ..mapping import mapping_options, sections
from ..measures import distortion_rows
from ..options import MESH_SUFFIXES, report_option, threads_option
from ..sections import SectionedCommand
from ..terminal import Terminal, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake import Mesh, UnwrapReport


@click.command(
    cls=SectionedCommand,
    sections=sections(),
    epilog="""
    \b
    Example:
      texbake unwrap low.obj -o low_uv.obj --size 2048 --padding 8
      texbake unwrap low.obj -o low_uv.glb --quality best --layout layout.png --heat
      texbake unwrap body.obj wheels.obj -o car --tiles 2 --texel-density 512
      texbake unwrap bottle.obj -o bottle_uv.obj --method cylindrical --caps --checker look.png
      texbake unwrap bunny.obj -o b.obj --method two-part --surface sphere --via object-normal
    """,
)
@click.argument("meshes", nargs=-1, required=True, type=FileOf(MESH_SUFFIXES), metavar="MESH...")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE|DIR",
    help="The mesh with texture coordinates; of several meshes, a folder for all.",
)
@mapping_options
@click.option(
    "--layout", type=FileOf((".png", ".svg")), metavar="FILE", help="Draw the charts, PNG or SVG."
)
@click.option("--heat", is_flag=True, help="Color the layout by stretch.")
@click.option(
    "--checker", type=FileOf((".png",)), metavar="FILE.png", help="Draw the mesh with a checker."
)
@report_option
@threads_option
@terminal_options
def unwrap(
    meshes: tuple[Path, ...],
    output: Path,
    options: UnwrapOptions,
    layout: Path | None,
    heat: bool,
    checker: Path | None,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Give MESH texture coordinates.

    By an atlas no two faces overlap and none is mirrored. Positions and the order of faces stay as
    they are. Several meshes share one atlas.
    """
    outputs = _outputs(meshes, output)
    if heat and layout is None:
        raise OptionError("heat: it colors the layout; give --layout FILE as well")
    check_distinct([*outputs, layout, checker, report])
    check_distinct([layout, checker, report], meshes)  # an output may replace its mesh
    check_picture(checker)
    check_report(report)
    import texbake
    from texbake.jobs.outputs import write_report
    from texbake.jobs.uv_pictures import check_layout

    if layout is not None:
        check_layout(layout)
    with terminal.progress() as progress:
        read = [texbake.read_mesh(path, progress=progress) for path in meshes]
        results = texbake.unwrap_together(read, options, threads=threads, progress=progress)
        if len(meshes) > 1:
            make_folder(output)
        for (mesh, _), path in zip(results, outputs, strict=True):
            texbake.write_mesh(mesh, path)
        unwrapped = [mesh for mesh, _ in results]
        if layout is not None:
            joined = _joined(unwrapped)
            texbake.write_layout(joined, layout, options.size, heat=heat, threads=threads)
        if checker is not None:
            picture = texbake.render_checker(_joined(unwrapped), threads=threads)
            texbake.write_image(picture, checker, color=True)
        reports = [figures.to_json() for _, figures in results]
        if report is not None:
            write_report(report, reports[0] if len(reports) == 1 else {"meshes": reports})
    for _, figures in results:
        for note in figures.notes:
            terminal.warn(f"{figures.mesh}: {note}")
        if len(results) > 1:
            terminal.summary([(figures.mesh, "")])
        terminal.summary(_rows(figures))
    terminal.wrote(path for path in (*outputs, layout, checker, report) if path is not None)


def _outputs(meshes: Sequence[Path], output: Path) -> list[Path]:
    """Return a file for each mesh, checked before any work."""
    if len(meshes) == 1:
        check_mesh(output)
        return [output]
    check_folder(output)
    files = [output / path.name for path in meshes]
    check_distinct(files)
    for file in files:
        check_mesh(file, folder_is_made=True)
    return files


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return all meshes as one, for pictures."""
    from texbake.mesh.compose import join_meshes

    return join_meshes(meshes)


def _rows(report: UnwrapReport) -> list[tuple[str, str]]:
    tallies = [(name, f"{count:,}") for name, count in report.tallies.items()]
    if report.distortion is None:
        measured = [("stretch", "none to measure: no face has an area in the texture")]
    else:
        measured = distortion_rows(report.distortion)
    return [("faces", f"{report.n_faces:,}"), *measured, *tallies]
