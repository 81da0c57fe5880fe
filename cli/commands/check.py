"""`texbake check`: find problems of a bake before it runs."""

from __future__ import annotations

import json
import shutil
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from texbake import CheckOptions
from texbake.checks.kinds import SEVERITIES
from texbake.errors import counted

from ..options import (
    MESH_SUFFIXES,
    mesh_argument,
    options_of,
    picture_option,
    report_option,
    threads_option,
)
from ..signals import FAILED
from ..terminal import Terminal, columns, say, terminal_options
from ..types import FileOf

if TYPE_CHECKING:
    from texbake.checks.check import CheckReport
    from texbake.checks.checked_mesh import Finding

_NEVER = "never"
_WORST_SHOWN = 5
_COLORS = {"error": "red", "warning": "yellow", "note": "blue"}


@click.command(
    epilog="""
    \b
    Example:
      texbake check low_uv.obj
      texbake check scan.ply low_uv.obj --size 2048 --padding 8 --explain
      texbake check scan.ply low_uv.obj --fail-on warning --report check.json
      texbake check low_uv.obj --allow overlapping-coordinates
      texbake check scan.ply low_uv.obj --layout layout.png --sides sides.png
    """
)
@mesh_argument("mesh")
@click.argument("low", required=False, type=FileOf(MESH_SUFFIXES))
@options_of(CheckOptions, without=("threads",))
@click.option(
    "--fail-on",
    type=click.Choice((*SEVERITIES, _NEVER)),
    default=SEVERITIES[0],
    show_default=True,
    help="Exit with 1 if a problem of this severity or a worse one is found.",
)
@picture_option("--layout", "Draw where the problems lie in the texture.")
@picture_option("--sides", "Draw where the problems lie on the meshes, seen from four sides.")
@click.option("--explain", is_flag=True, help="Explain warnings and notes as well as errors.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else.")
@report_option
@threads_option
@terminal_options
@click.pass_context
def check(
    ctx: click.Context,
    /,
    mesh: Path,
    low: Path | None,
    fail_on: str,
    layout: Path | None,
    sides: Path | None,
    explain: bool,
    as_json: bool,
    report: Path | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Find problems of a bake before it runs.

    Checks MESH as a low-poly mesh, or as a high-poly one if it has no texture coordinates. With LOW
    it checks the pair: MESH is the high-poly mesh that is going to be baked onto LOW. Exits with 1
    if there are errors.
    """
    options = CheckOptions(**choices)
    from texbake.jobs.check_meshes import check_mesh_files

    with terminal.progress() as progress:
        done = check_mesh_files(
            mesh, low, options, layout=layout, sides=sides, report=report, progress=progress
        )
    checked = done.report
    for warning in done.warnings:
        terminal.warn(warning)
    if as_json:
        say(json.dumps(checked.to_json(), indent=2, allow_nan=False))
    else:
        _print_findings(checked, terminal, explain=explain)
        terminal.wrote(done.files)
        if not terminal.quiet:
            say(_verdict_on_all(checked, SEVERITIES[0] if fail_on == _NEVER else fail_on))
    if fail_on != _NEVER and checked.fails(fail_on):
        ctx.exit(FAILED)


def _print_findings(checked: CheckReport, terminal: Terminal, *, explain: bool) -> None:
    """Print a table of findings, and what errors mean."""
    findings = checked.findings
    if not terminal.quiet:
        for role, mesh in (("high-poly", checked.high), ("low-poly", checked.low)):
            if mesh is not None:
                say(f"{role} mesh  {mesh.name}, {counted(mesh.n_polygons, 'face')}")
    if findings:
        columns(
            [
                ("severity", "mesh", "found", "", "worst faces"),
                *((_verdict(f), f.mesh, f.counted, f.kind.title, _worst(f)) for f in findings),
            ]
        )
    if not terminal.quiet:
        _explain([f for f in findings if explain or _verdict(f) == SEVERITIES[0]])
        if not explain and any(_verdict(f) != SEVERITIES[0] for f in findings):
            say("\nWhat the rest means, and what to do: add --explain")


def _explain(findings: list[Finding]) -> None:
    """Print what each finding means, and what to do."""
    width = max(40, min(shutil.get_terminal_size((100, 0)).columns, 100))
    for finding in findings:
        say("")
        title = f"{finding.kind.title} ({finding.mesh}): {finding.name}"
        say(title, fg=_COLORS[finding.severity], bold=True)
        for text in (finding.problem, finding.remedy):
            say(textwrap.fill(text, width, initial_indent="  ", subsequent_indent="  "))


def _verdict(finding: Finding) -> str:
    return "allowed" if finding.allowed else finding.severity


def _worst(finding: Finding) -> str:
    shown = ", ".join(str(face) for face in finding.worst_faces[:_WORST_SHOWN])
    return f"{shown}, ..." if len(finding.polygons) > _WORST_SHOWN else shown


def _verdict_on_all(checked: CheckReport, least: str) -> str:
    """One line: whether a finding is as severe as `least`, and how many findings there are."""
    counts = [
        counted(checked.count(severity), severity)
        for severity in SEVERITIES
        if checked.count(severity)
    ]
    if checked.n_allowed:
        counts.append(f"{checked.n_allowed} allowed")
    verdict = "Not ready to bake" if checked.fails(least) else "Ready to bake"
    return ", ".join((verdict, *counts))
