"""Limits that a mesh, or a pair of meshes, must keep; steps that come `after` wait for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texbake.building.memory import (
    IDLE_WORKER,
    READ_FACE,
    TEXEL,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.figures import steady
from texbake.checks.options import SEVERITIES, CheckOptions
from texbake.errors import MeshError, OptionError, UvError

if TYPE_CHECKING:
    from texbake.checks.report import CheckReport

NEVER = "never"


@dataclass(frozen=True, kw_only=True)
class CheckStep(CheckOptions):
    """What is allowed; further attributes are those of `CheckOptions`.

    Attributes
    ----------
    fail_on : str
        Severity from which on a finding fails the asset, or `never`.
    max_stretch : float, optional
        Most L2 stretch of the light mesh's texture coordinates as a whole, above 1.
    max_faces : int, optional
        Most triangles of the light mesh.
    """

    fail_on: str = SEVERITIES[0]
    max_stretch: float | None = None
    max_faces: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fail_on not in (*SEVERITIES, NEVER):
            known = ", ".join((*SEVERITIES, NEVER))
            raise OptionError(f"fail_on: {self.fail_on!r} is not one of {known}")
        if self.max_stretch is not None and not 1.0 < self.max_stretch < math.inf:
            raise OptionError(f"max_stretch: {self.max_stretch} must be above 1, such as 1.2")
        if self.max_faces is not None and self.max_faces < 1:
            raise OptionError(f"max_faces: {self.max_faces} must be at least 1")


def _run(job: Job) -> dict[str, Any]:
    from texbake.checks.check import check_files
    from texbake.jobs.report import write_report

    options: CheckStep = CHECK.made(job.settings, threads=job.threads)
    report = check_files(job.file("mesh"), job.input("low"), options)
    stretch = _stretch(report)
    _hold(report, stretch, options, job.file("mesh").name)
    write_report(job.outputs["report"], steady({**report.to_json(), "stretch_l2": stretch}))
    return {
        "errors": report.count("error"),
        "warnings": report.count("warning"),
        "stretch_l2": stretch,
        "notes": [f"{f.kind.title}: {f.counted}" for f in report.findings],
    }


def _stretch(report: CheckReport) -> float | None:
    """L2 stretch of the light mesh, or None where it has no coordinates that could be measured."""
    from texbake.mapping.distortion import distortion

    if not report.has_layout or report.light is None:
        return None
    try:
        size = report.options.width_px, report.options.height_px
        return distortion(report.light, size, threads=report.options.threads).turned_stretch.l2
    except UvError:
        return None


def _hold(report: CheckReport, stretch: float | None, options: CheckStep, name: str) -> None:
    """Raise where a limit is exceeded."""
    if options.fail_on != NEVER and report.fails(options.fail_on):
        severe = SEVERITIES[: SEVERITIES.index(options.fail_on) + 1]
        told = [
            f"{finding.kind.title.lower()} ({finding.counted})"
            for finding in report.findings
            if finding.severity in severe
        ]
        raise MeshError(f"{name}: the check found {', '.join(told)}; see: texbake check")
    light = report.light
    if options.max_faces is not None and light is not None and light.n_faces > options.max_faces:
        raise MeshError(
            f"{name}: {light.n_faces:,} triangles are more than max_faces, {options.max_faces:,}"
        )
    if options.max_stretch is not None and not (stretch or math.inf) <= options.max_stretch:
        shown = "not measurable" if stretch is None else f"{stretch:.4g}"
        raise UvError(
            f"{name}: L2 stretch is {shown}, max_stretch is {options.max_stretch:g}; "
            "unwrap it with that max_stretch"
        )


def _memory(settings: Settings, sizes: Sizes) -> int:
    side = settings["size"]
    texels = side[0] * side[1] if isinstance(side, list) else side * side
    faces = faces_of(sizes, "mesh") + faces_of(sizes, "low")
    return int(IDLE_WORKER + 2 * READ_FACE * faces + TEXEL * texels)


CHECK = StepKind(
    name="check",
    does="fails where a mesh or a pair does not keep to limits",
    options=CheckStep,
    inputs=(InputRole(name="mesh"), InputRole(name="low", required=False)),
    outputs=lambda settings: {"report": "check.json"},
    run=_run,
    memory=_memory,
)
