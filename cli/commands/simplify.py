"""`texbake simplify`: reduce the triangles of a mesh."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import texbake
from texbake import (
    SimplifyOptions,
)

from ..options import (
    WRITABLE_MESH_SUFFIXES,
    mesh_argument,
    options_of,
    output_file,
    report_option,
    threads_option,
)
from ..terminal import Terminal, terminal_options

if TYPE_CHECKING:
    from texbake import SimplifyReport


@click.command(
    epilog="""
    \b
    Example:
      texbake simplify scan.ply -o low.obj --faces 500
      texbake simplify scan.ply -o low.obj --faces 2000 --quality best
      texbake simplify scan.ply -o low.obj --error 0.1%
    """
)
@mesh_argument("mesh")
@output_file("The simplified mesh.", WRITABLE_MESH_SUFFIXES)
@options_of(SimplifyOptions)
@report_option
@threads_option
@terminal_options
def simplify(
    mesh: Path,
    output: Path,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Reduce MESH to fewer triangles.

    Keeps boundaries, hard edges and seams of texture coordinates; GLB and OBJ files keep materials,
    too. Prints how many faces were reached and how far the two surfaces lie apart, measured both
    ways.
    """
    with terminal.progress() as progress:
        done = texbake.simplify_file(
            mesh,
            output,
            **asdict(SimplifyOptions(**choices)),
            report=report,
            threads=threads,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(_rows(done.report))
    terminal.wrote(done.files)


def _rows(report: SimplifyReport) -> list[tuple[str, str]]:
    distance = report.distance
    return [
        ("triangles", f"{report.n_faces_before:,} to {report.n_faces:,}"),
        ("vertices", f"{report.n_vertices:,}"),
        ("method", report.method),
        (
            "distance, both ways",
            f"RMS {distance.rms:.4g} ({100 * distance.rms_relative:.3f} % of the diagonal), "
            f"greatest {distance.max:.4g} ({100 * distance.max_relative:.3f} %)",
        ),
        ("time", f"{report.seconds:.2f} s"),
    ]
