"""Printers for results of more than one table: findings, the content of a mesh file, plans."""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, Any

import click

from texbake.checks.bake_kinds import SEVERITIES
from texbake.errors import counted

from .signals import FAILED
from .terminal import Terminal, columns, say, table

if TYPE_CHECKING:
    from texbake.checks.check import CheckReport
    from texbake.checks.checked_mesh import Finding
    from texbake.jobs.outputs import JobResult
    from texbake.jobs.preview import PreviewFiles
    from texbake.verbs.info import MeshFileInfo

_NEVER = "never"
_WORST_SHOWN = 5
_COLORS = {"error": "red", "warning": "yellow", "note": "blue"}


def print_info(
    terminal: Terminal, result: JobResult[MeshFileInfo], values: Mapping[str, Any]
) -> int:
    """Print what is in a mesh file."""
    if values["as_json"]:
        say(json.dumps(result.to_json(), indent=2, allow_nan=False))
    else:
        for rows in result.report.tables():
            if len(rows[0]) == 2:
                table(rows)
            else:
                columns(rows, numbers=len(rows[0]))
    return 0


def print_check(terminal: Terminal, result: JobResult[Any], values: Mapping[str, Any]) -> int:
    """Print the findings of a check and its verdict; return the exit code."""
    from texbake.checks.report_formats import junit_of, sarif_of

    checked, fail_on = result.report, values["fail_on"]
    reports: tuple[CheckReport, ...] = getattr(checked, "reports", (checked,))
    form = "json" if values["as_json"] else values["form"]
    if form == "json":
        say(json.dumps(checked.to_json(), indent=2, allow_nan=False))
    elif form == "sarif":
        say(json.dumps(sarif_of(reports), indent=2, allow_nan=False))
    elif form == "junit":
        say(junit_of(reports, None if fail_on == _NEVER else fail_on))
    else:
        for number, report in enumerate(reports):
            if number and not terminal.quiet:
                say("")
            if len(reports) > 1 and report.findings:
                say(report.file_of(None), bold=True)
            _print_findings(report, terminal, explain=values["explain"])
            if report is reports[-1]:
                terminal.wrote(result.files)
            if not terminal.quiet:
                say(_verdict_on_all(report, SEVERITIES[0] if fail_on == _NEVER else fail_on))
    if form != "text":  # stage times follow with --verbose
        click.get_current_context().with_resource(redirect_stdout(sys.stderr))
    return FAILED if fail_on != _NEVER and any(r.fails(fail_on) for r in reports) else 0


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


def print_preview(terminal: Terminal, result: PreviewFiles, values: Mapping[str, Any]) -> int:
    """Print which passes were chosen, and what was left out; or what each changes."""
    form = values["explain"] or ("table" if values["plan_only"] else None)
    if form == "changes":
        columns(result.contributions_table(), numbers=5)
    elif form == "json":
        say(json.dumps(result.to_json(), indent=2))
    elif form is not None:
        rows, left_out = result.plan_tables()
        columns(rows, numbers=0 if result.costs is None else 2)
        say("")
        columns([("left out", "because"), *left_out])
    terminal.summary(result.table())
    if not values["plan_only"]:
        terminal.wrote(result.files)
    return 0


# For each verb, a function that prints its result, given the values of the command's options, and
# returns the exit code.
PRINTERS: dict[str, Callable[[Terminal, Any, Mapping[str, Any]], int]] = {
    "check": print_check, "info": print_info, "preview": print_preview,
}  # fmt: skip
