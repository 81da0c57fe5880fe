"""`texbake remesh`: wrap any triangles in a closed surface, or remesh open ones as sheets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import texbake
from texbake import RemeshOptions

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
    from texbake import RemeshReport


@click.command(
    epilog="""
    \b
    Example:
      texbake remesh scan.ply -o closed.ply
      texbake remesh generated.glb -o closed.ply --resolution 512 --components largest
      texbake remesh holes.ply -o low.obj --close 5% --faces 5000
      texbake remesh bottle.ply -o hollow.ply --keep-interior
      texbake remesh face.ply -o even.ply --surface open --close 2%
    """
)
@mesh_argument("mesh")
@output_file("The new mesh; it may replace MESH.", WRITABLE_MESH_SUFFIXES)
@options_of(RemeshOptions)
@report_option
@threads_option
@terminal_options
def remesh(
    mesh: Path,
    output: Path,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Give MESH a new surface, closed or open.

    The closed surface of a body encloses what is seen from outside. MESH may be any triangles:
    doubled and inner walls vanish, overlapping parts become one, and holes and gaps are closed. The
    result is manifold and faces outwards. Its vertices lie on MESH; sheets without thickness get
    some.

    An open surface, such as a range scan, cloth or terrain, stays one sheet with its boundary.
    The result has no texture coordinates.
    """
    options = RemeshOptions(**choices)
    with terminal.progress() as progress:
        done = texbake.remesh_file(
            mesh, output, options, report=report, threads=threads, progress=progress
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(_rows(done.report))
    terminal.wrote(done.files)


def _rows(report: RemeshReport) -> list[tuple[str, str]]:
    distance, diagonal = report.distance, report.diagonal
    return [
        ("triangles", f"{report.n_faces_before:,} to {report.n_faces:,}"),
        ("surface", f"{report.surface}: {report.reason}"),
        ("holes filled", f"{report.n_holes_filled:,}"),
        ("separate parts", f"{report.n_components:,}"),
        (
            "cavities",
            f"{report.n_cavities_kept:,} kept, {report.n_cavities_filled:,} filled",
        ),
        ("voxel", f"{report.voxel:.4g}"),
        ("gaps closed up to", f"{report.gap:.4g}"),
        (
            "distance to MESH",
            f"RMS {distance.rms:.4g} ({100 * distance.rms / diagonal:.3f} % of the diagonal), "
            f"greatest {distance.max:.4g} ({100 * distance.max / diagonal:.3f} %)",
        ),
        ("time", f"{report.seconds:.2f} s"),
    ]
