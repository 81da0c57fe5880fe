"""Reports of checks for other programs: SARIF for code scanning, JUnit XML for CI.

Based on: OASIS, Static Analysis Results Interchange Format (SARIF) Version 2.1.0; JUnit's XML as
Jenkins and GitLab read it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

from texbake import __version__
from texbake.checks.bake_kinds import SEVERITIES
from texbake.checks.check import CheckReport
from texbake.checks.checked_mesh import Finding
from texbake.checks.kinds import KINDS


def sarif_of(reports: Sequence[CheckReport]) -> dict[str, Any]:
    """Return the log of one run, with a rule for each kind of finding."""
    found = [(report, finding) for report in reports for finding in report.findings]
    names = [name for name in KINDS if any(finding.name == name for _, finding in found)]
    rules = [
        {
            "id": name,
            "shortDescription": {"text": KINDS[name].title},
            "defaultConfiguration": {"level": KINDS[name].severity},
        }
        for name in names
    ]
    results = [_result(report, finding, names.index(finding.name)) for report, finding in found]
    driver = {"name": "texbake", "version": __version__, "rules": rules}
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "results": results}],
    }


def _result(report: CheckReport, finding: Finding, rule: int) -> dict[str, Any]:
    uri = quote(os.fsencode(PurePath(report.file_of(finding)).as_posix()))
    place = {"artifactLocation": {"uri": uri}, "region": {"startLine": 1}}
    result = {
        "ruleId": finding.name,
        "ruleIndex": rule,
        "level": finding.severity,
        "message": {"text": f"{_line(finding)} {finding.problem} {finding.remedy}"},
        "locations": [{"physicalLocation": place}],
        "properties": {"count": finding.count, "worstFaces": finding.worst_faces},
    }
    return {**result, "suppressions": [{"kind": "external"}]} if finding.allowed else result


def junit_of(reports: Sequence[CheckReport], fail_on: str | None) -> str:
    """Return a suite for each check and a case for each finding, failed from `fail_on` on."""
    fatal = () if fail_on is None else SEVERITIES[: SEVERITIES.index(fail_on) + 1]
    suites = ElementTree.Element("testsuites", name="texbake check")
    for report in reports:
        file = report.file_of(None)
        failed = [f for f in report.findings if f.severity in fatal and not f.allowed]
        suite = ElementTree.SubElement(
            suites, "testsuite", name=file, tests=str(len(report.findings) or 1),
            failures=str(len(failed)), skipped=str(report.n_allowed), time=f"{report.seconds:.3f}",
        )  # fmt: skip
        if not report.findings:
            ElementTree.SubElement(suite, "testcase", classname=file, name="ready to bake")
        for finding in report.findings:
            name = f"{finding.name} ({finding.mesh})"
            case = ElementTree.SubElement(suite, "testcase", classname=file, name=name)
            text = f"{finding.problem} {finding.remedy}"
            if finding.allowed:
                ElementTree.SubElement(case, "skipped", message="allowed")
            elif finding.severity in fatal:
                more = {"message": _line(finding), "type": finding.severity}
                ElementTree.SubElement(case, "failure", more).text = text
            else:
                ElementTree.SubElement(case, "system-out").text = f"{_line(finding)} {text}"
    ElementTree.indent(suites)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(suites, "unicode")


def _line(finding: Finding) -> str:
    return f"{finding.kind.title} ({finding.counted})."
