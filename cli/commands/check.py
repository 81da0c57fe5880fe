"""`texbake check`: what will go wrong in a bake, before it does."""

from __future__ import annotations

import json
import shutil
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake.checks.options import SEVERITIES, CheckOptions
from texbake.jobs.outputs import check_distinct, check_picture, check_report

from ..options import (
    MESH_SUFFIXES,
    choice_option,
    mesh_argument,
    number_option,
    picture_option,
    report_option,
    size_option,
    threads_option,
)
from ..terminal import Terminal, columns, say, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake.checks.finding import Finding
    from texbake.checks.report import CheckReport
    from texbake.progress import ProgressSink

_NEVER = "never"
_WORST_SHOWN = 5
_COLORS = {"error": "red", "warning": "yellow", "note": "blue"}


@click.command(
    epilog="""
    \b
    Example:
      texbake check low_uv.obj
      texbake check scan.ply low_uv.obj --size 2048 --padding 8
      texbake check scan.ply low_uv.obj --fail-on warning --report check.json
      texbake check scan.ply low_uv.obj --layout layout.png --sides sides.png
    """
)
@mesh_argument("mesh")
@click.argument("low", required=False, type=FileOf(MESH_SUFFIXES))
@size_option(CheckOptions.size, "Texels of the maps that are to be baked.")
@number_option(
    "--padding", int, CheckOptions.padding, "PX", "Texels around each chart that the bake fills."
)
@number_option(
    "--min-texel-density",
    float,
    CheckOptions.min_texel_density,
    "D",
    "Texels a model unit that every face must get.  [default: a quarter of the mean]",
)
@choice_option(
    "--fail-on",
    (*SEVERITIES, _NEVER),
    SEVERITIES[0],
    "Exit with 1 where something as severe as this is found, or worse.",
)
@picture_option("--layout", "Draw where in the texture.")
@picture_option("--sides", "Draw where on the meshes, from four sides.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON alone.")
@report_option
@threads_option
@terminal_options
@click.pass_context
def check(
    ctx: click.Context,
    mesh: Path,
    low: Path | None,
    size: int | tuple[int, int],
    padding: int,
    min_texel_density: float | None,
    fail_on: str,
    layout: Path | None,
    sides: Path | None,
    as_json: bool,
    report: Path | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Name what will go wrong in a bake before it does.

    MESH alone is looked at as a light mesh, or as a dense one if it has no texture coordinates;
    with LOW it is the dense mesh that is to be baked onto LOW. Exits with 1 if there are errors.
    """
    options = CheckOptions(
        size=size, padding=padding, min_texel_density=min_texel_density, threads=threads
    )
    check_distinct([layout, sides, report], [mesh, low])
    check_picture(layout)
    check_picture(sides)
    check_report(report)
    from texbake.checks.check import check_files
    from texbake.jobs.outputs import write_report

    with terminal.progress() as progress:
        checked = check_files(mesh, low, options, progress=progress)
        drawn = _draw(checked, layout, sides, terminal, progress)
        if report is not None:
            write_report(report, checked.to_json())
    if as_json:
        say(json.dumps(checked.to_json(), indent=2, allow_nan=False))
    else:
        _tell(checked, terminal)
        terminal.wrote([*drawn, *([report] if report is not None else [])])
    if fail_on != _NEVER and checked.fails(fail_on):
        ctx.exit(1)


def _draw(
    checked: CheckReport,
    layout: Path | None,
    sides: Path | None,
    terminal: Terminal,
    progress: ProgressSink | None,
) -> list[Path]:
    """Write the pictures asked for, as far as there is something to draw; return which."""
    import texbake

    written = []
    if layout is not None:
        if not checked.has_layout:
            terminal.warn(f"{layout}: not drawn; there are no texture coordinates to draw in")
        else:
            texbake.write_image(checked.picture(), layout, color=True)
            written.append(layout)
    if sides is not None:
        if not any(len(finding.faces) for finding in checked.findings):
            terminal.warn(f"{sides}: not drawn; nothing was found at any face")
        else:
            from texbake.jobs.check_meshes import render_findings

            threads = checked.options.threads
            picture = render_findings(checked, threads=threads, progress=progress)
            texbake.write_image(picture, sides, color=True, threads=threads)
            written.append(sides)
    return written


def _tell(checked: CheckReport, terminal: Terminal) -> None:
    """Print the findings as a table, and below it what they mean."""
    findings = checked.findings
    if not terminal.quiet:
        for role, mesh in (("dense", checked.dense), ("light", checked.light)):
            if mesh is not None:
                say(f"{role} mesh  {mesh.name}, {mesh.n_faces:,} faces")
    if findings:
        columns(
            [
                ("severity", "mesh", "found", "", "worst faces"),
                *((f.severity, f.mesh, f.counted, f.kind.title, _worst(f)) for f in findings),
            ]
        )
    if terminal.quiet:
        return
    width = max(40, min(shutil.get_terminal_size((100, 0)).columns, 100))
    for finding in findings:
        say("")
        title = click.style(finding.kind.title, fg=_COLORS[finding.severity], bold=True)
        say(f"{title} ({finding.mesh})")
        for text in (finding.problem, finding.remedy):
            say(textwrap.fill(text, width, initial_indent="  ", subsequent_indent="  "))
    if findings:
        say("")
    say(_total(checked))


def _worst(finding: Finding) -> str:
    shown = ", ".join(str(face) for face in finding.worst_faces[:_WORST_SHOWN])
    return f"{shown}, ..." if len(finding.faces) > _WORST_SHOWN else shown


def _total(checked: CheckReport) -> str:
    """One line: how many of each severity."""
    counts = [
        f"{n} {severity}{'s' * (n != 1)}"
        for severity in SEVERITIES
        if (n := checked.count(severity))
    ]
    return ", ".join(counts) or "nothing found"
