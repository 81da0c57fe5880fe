"""`check`: find problems of a bake before it runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import PROCESS, TEXEL
from texbake.checks.bake_kinds import SEVERITIES
from texbake.checks.kinds import CheckOptions
from texbake.errors import MeshError, OptionError, UvError, quoted
from texbake.files import PathLike
from texbake.records import dataclass
from texbake.verbs.step import (
    READ_FACE,
    Job,
    Settings,
    Sizes,
    n_faces,
    n_texels,
    step_of,
    without_timings,
)
from texbake.verbs.verb import REPORT, Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.checks.check import CheckReport
    from texbake.jobs.outputs import JobResult
    from texbake.progress import Progress

NEVER = "never"  # no finding fails
FORMS = ("text", "json", "sarif", "junit")


@dataclass(frozen=True)
class CheckReports:
    """Findings of meshes that were checked one by one."""

    reports: tuple[CheckReport, ...]

    def to_json(self) -> dict[str, Any]:
        """Return all of it as plain values, for `json.dump`."""
        return {"meshes": [report.to_json() for report in self.reports]}


@verb(
    Reads("mesh"),
    Reads("low", argument=True, required=False),
    Extra("more", nargs=-1, metavar="[MORE]..."),
    Extra("--each", "Check each mesh by itself, instead of a pair.", is_flag=True),
    Options(CheckOptions, without=("threads",)),
    Extra(
        "--fail-on",
        "Exit with 1 if a problem of this severity or a worse one is found.",
        choices=(*SEVERITIES, NEVER),
        default=SEVERITIES[0],
        show_default=True,
    ),
    Writes("layout", "picture", "Draw where the problems lie in the texture."),
    Writes("sides", "picture", "Draw where the problems lie on the meshes, seen from four sides."),
    Extra("--explain", "Explain warnings and notes as well as errors.", is_flag=True),
    Extra(
        "--format form",
        "Format of the report: SARIF 2.1.0 is for code scanning, JUnit XML for CI.",
        choices=FORMS,
        default=FORMS[0],
        show_default=True,
    ),
    Extra("--json as_json", "The same as --format json.", is_flag=True),
    REPORT,
    Options(CheckOptions, "threads"),
    examples="""
      texbake check low_uv.obj
      texbake check scan.ply low_uv.obj --size 2048 --padding 8 --explain
      texbake check scan.ply low_uv.obj --fail-on warning --report check.json
      texbake check low_uv.obj --allow overlapping-coordinates
      texbake check scan.ply low_uv.obj --layout layout.png --sides sides.png
      texbake check chair.glb lamp.glb --each --profile gltf-web --format sarif
    """,
)
def check_files(
    mesh: PathLike,
    low: PathLike | None = None,
    options: CheckOptions | None = None,
    *,
    more: Sequence[PathLike] = (),
    each: bool = False,
    layout: PathLike | None = None,
    sides: PathLike | None = None,
    report: PathLike | None = None,
    progress: Progress = None,
) -> JobResult[Any]:
    """Find problems of a bake before it runs.

    Checks MESH as a low-poly mesh, or as a high-poly one if it has no texture coordinates. With LOW
    it checks the pair: MESH is the high-poly mesh that is going to be baked onto LOW. With --each
    there may be any number of meshes, each of which is checked by itself. Exits with 1 if there are
    errors.
    """
    from texbake.checks.check import check_files as read_and_check
    from texbake.jobs.outputs import JobResult, present_paths

    if each:
        if layout is not None or sides is not None:
            raise OptionError("each: pictures show one mesh or one pair; leave one of them out")
        paths = present_paths(mesh, low, *more)
        found = [
            read_and_check(path, None, options, missing=True, progress=progress) for path in paths
        ]
        return JobResult(files=(), report=CheckReports(tuple(found)))
    if more:
        raise OptionError("a pair has two meshes; give `each` to check each mesh by itself")
    checked = read_and_check(mesh, low, options, progress=progress)
    files, warnings = [], []
    if layout is not None and checked.has_layout:
        from texbake.texture.image import write_image

        write_image(checked.picture(), layout, color=True)
        files.append(layout)
    elif layout is not None:
        warnings.append(f"{layout}: not drawn; there are no texture coordinates to draw in")
    if sides is not None and any(len(finding.faces) for finding in checked.findings):
        from texbake.jobs.side_pictures import write_findings

        write_findings(checked, sides, progress=progress)
        files.append(sides)
    elif sides is not None:
        warnings.append(f"{sides}: not drawn; no finding is at any face")
    return JobResult(files=present_paths(*files), report=checked, warnings=tuple(warnings))


@dataclass(frozen=True, kw_only=True)
class CheckStep(CheckOptions):
    """Which findings and figures are allowed; further attributes are those of `CheckOptions`.

    Attributes
    ----------
    fail_on : str
        The least severity at which a finding fails the asset, or `never`.
    max_stretch : float, optional
        Greatest L2 stretch of the low-poly mesh's texture coordinates as a whole, above 1.
    max_faces : int, optional
        Greatest number of triangles of the low-poly mesh.
    """

    fail_on: str = SEVERITIES[0]
    max_stretch: float | None = None
    max_faces: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fail_on not in (*SEVERITIES, NEVER):
            known = ", ".join((*SEVERITIES, NEVER))
            raise OptionError(f"fail_on: {quoted(self.fail_on)} is not one of {known}")
        if self.max_stretch is not None and not 1.0 < self.max_stretch < math.inf:
            raise OptionError(f"max_stretch: {self.max_stretch} must be above 1, such as 1.2")
        if self.max_faces is not None and self.max_faces < 1:
            raise OptionError(f"max_faces: {self.max_faces} must be at least 1")


def _check_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for checking a mesh or a pair."""
    return int(PROCESS + 2 * READ_FACE * n_faces(sizes, "mesh", "low") + TEXEL * n_texels(settings))


def _check(job: Job) -> dict[str, Any]:
    from texbake.jobs.outputs import write_report

    options: CheckStep = CHECK.made(job.settings, threads=job.threads)
    report = check_files(job.file("mesh"), job.input("low"), options).report
    stretch = _stretch(report)
    _check_limits(report, stretch, options, job.file("mesh").name)
    write_report(
        job.outputs["report"], without_timings({**report.to_json(), "stretch_l2": stretch})
    )
    return {
        "errors": report.count("error"),
        "warnings": report.count("warning"),
        "stretch_l2": stretch,
        "notes": [f"{f.kind.title}: {f.counted}" for f in report.findings],
    }


def _stretch(report: CheckReport) -> float | None:
    """L2 stretch of the low-poly mesh; None if its texture coordinates cannot be measured."""
    from texbake.mapping.distortion import distortion

    if not report.has_layout or report.low is None:
        return None
    try:
        size = report.options.width_px, report.options.height_px
        return distortion(report.low, size, threads=report.options.threads).turned_stretch.l2
    except UvError:
        return None


def _check_limits(
    report: CheckReport, stretch: float | None, options: CheckStep, name: str
) -> None:
    """Raise where a limit is exceeded."""
    if options.fail_on != NEVER and report.fails(options.fail_on):
        severe = SEVERITIES[: SEVERITIES.index(options.fail_on) + 1]
        findings = [
            f"{finding.kind.title.lower()} ({finding.counted})"
            for finding in report.findings
            if finding.severity in severe and not finding.allowed
        ]
        raise MeshError(f"{name}: the check found {', '.join(findings)}; see: texbake check")
    low = report.low
    if options.max_faces is not None and low is not None and low.n_faces > options.max_faces:
        raise MeshError(
            f"{name}: {low.n_faces:,} triangles are more than max_faces, {options.max_faces:,}"
        )
    if options.max_stretch is not None and not (stretch or math.inf) <= options.max_stretch:
        shown = "not measurable" if stretch is None else f"{stretch:.4g}"
        raise UvError(
            f"{name}: L2 stretch is {shown}, max_stretch is {options.max_stretch:g}; "
            "unwrap it with that max_stretch"
        )


CHECK = step_of(
    check_files,
    does="fails if a mesh or a pair exceeds limits",
    options=CheckStep,
    outputs=lambda settings: {"report": "check.json"},
    run=_check,
    memory=_check_memory,
)
