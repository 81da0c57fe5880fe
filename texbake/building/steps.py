"""All kinds of steps: those of verbs, and those that judge and show an asset, which stand here."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import MB, PROCESS, TEXEL
from texbake.checks.kinds import SEVERITIES, CheckOptions
from texbake.errors import MeshError, OptionError, UvError, quoted
from texbake.rendering.options import RenderOptions
from texbake.verbs.step import (
    DECODED,
    READ_FACE,
    Job,
    Settings,
    Sizes,
    StepKind,
    find_step,
    n_bytes,
    n_faces,
    n_texels,
    without_timings,
)
from texbake.verbs.verb import Reads

if TYPE_CHECKING:
    from texbake.checks.check import CheckReport

_NEVER = "never"
# Maps that `preview` and `page` show.
_SHOWN = ("normal_map", "displacement", "albedo")
# Bytes per sample of a picture, and per triangle that displacement divides a mesh into.
_SAMPLE, _DIVIDED = 120, 150


def _check_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for checking a mesh or a pair."""
    faces = n_faces(sizes, "mesh", "low")
    return int(PROCESS + 2 * READ_FACE * faces + TEXEL * n_texels(settings))


def _preview_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a picture of a mesh with its maps."""
    samples = settings["width"] * settings["height"] * settings["supersampling"] ** 2
    divided = _DIVIDED * settings["max_triangles"] if sizes.get("displacement") else 0
    images = DECODED * n_bytes(sizes, *_SHOWN)
    mesh = READ_FACE * n_faces(sizes, "mesh")
    return int(PROCESS + 64 * MB + _SAMPLE * samples + mesh + images + divided)


def _page_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for the page of an asset."""
    images = 80 * n_bytes(sizes, *_SHOWN, "misses")
    return int(PROCESS + 400 * MB + images + 2 * READ_FACE * n_faces(sizes, "high", "low"))


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
        if self.fail_on not in (*SEVERITIES, _NEVER):
            known = ", ".join((*SEVERITIES, _NEVER))
            raise OptionError(f"fail_on: {quoted(self.fail_on)} is not one of {known}")
        if self.max_stretch is not None and not 1.0 < self.max_stretch < math.inf:
            raise OptionError(f"max_stretch: {self.max_stretch} must be above 1, such as 1.2")
        if self.max_faces is not None and self.max_faces < 1:
            raise OptionError(f"max_faces: {self.max_faces} must be at least 1")


def _check(job: Job) -> dict[str, Any]:
    from texbake.jobs.check_meshes import check_mesh_files
    from texbake.jobs.outputs import write_report

    options: CheckStep = CHECK.made(job.settings, threads=job.threads)
    report = check_mesh_files(job.file("mesh"), job.input("low"), options).report
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
    if options.fail_on != _NEVER and report.fails(options.fail_on):
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


CHECK = StepKind(
    name="check",
    does="fails if a mesh or a pair exceeds limits",
    options=CheckStep,
    inputs=(Reads("mesh"), Reads("low", required=False)),
    outputs=lambda settings: {"report": "check.json"},
    run=_check,
    memory=_check_memory,
)


def _preview(job: Job) -> dict[str, Any]:
    from texbake.jobs.preview import preview_files
    from texbake.jobs.preview_scene import MeshMaps

    maps: dict[str, Any] = {name: job.input(name) for name in _SHOWN}
    preview_files(
        job.file("mesh"),
        job.outputs["picture"],
        vars(PREVIEW.made(job.settings)),
        maps=MeshMaps(**maps, replaces=True),
        threads=job.threads,
    )
    return {}


PREVIEW = StepKind(
    name="preview",
    does="draws a mesh with its maps",
    options=RenderOptions,
    without=("time_budget",),
    inputs=(
        Reads("mesh"),
        *(Reads(name, required=False) for name in _SHOWN),
    ),
    outputs=lambda settings: {"picture": "preview.png"},
    run=_preview,
    memory=_preview_memory,
)


@dataclass(frozen=True, kw_only=True)
class PageStep:
    """From where the pictures and the view of a page look at the asset.

    Attributes
    ----------
    view
        Azimuth and elevation of the camera in degrees, and its distance in model units.
    up : str
        Axis of the world that is up in the pictures: y or z.
    size : int
        Width and height of the pictures, in pixels.
    """

    view: tuple[float, float] | tuple[float, float, float | None] = RenderOptions.view
    up: str = RenderOptions.up
    size: int = 560

    def __post_init__(self) -> None:
        _ = self.picture  # raises what is wrong with them

    @property
    def picture(self) -> RenderOptions:
        """Options of the pictures."""
        return RenderOptions(width=self.size, height=self.size, view=self.view, up=self.up)


def _page(job: Job) -> dict[str, Any]:
    from texbake.jobs.comparison import page_file

    options: PageStep = PAGE.made(job.settings)
    maps = {name.removesuffix("_map"): file for name in _SHOWN if (file := job.input(name))}
    comparison = page_file(
        job.file("high"),
        job.file("low"),
        job.outputs["page"],
        options.picture,
        name=job.asset,
        maps=maps,
        misses=job.input("misses"),
        threads=job.threads,
    ).report
    if comparison is None:
        return {}
    return {"error_deg": comparison.mapped.mean_deg, "bare_error_deg": comparison.bare.mean_deg}


PAGE = StepKind(
    name="page",
    does="writes a page of an asset: the meshes, their maps, errors",
    options=PageStep,
    without=(),
    inputs=(
        Reads("high"),
        Reads("low"),
        *(Reads(role, required=False) for role in (*_SHOWN, "misses")),
    ),
    outputs=lambda settings: {"page": "page.html"},
    run=_page,
    memory=_page_memory,
    names_asset=True,
)


_HERE = {kind.name: kind for kind in (CHECK, PREVIEW, PAGE)}
# In the order in which a pipeline usually has them.
_NAMES = (
    *("make", "repair", "transform", "remesh", "simplify", "unwrap", "check", "bake"),
    *("bake-texture", "pack-textures", "pack-channels", "split-channels", "mipmap"),
    *("preview", "page", "export"),
)
STEP_KINDS: dict[str, StepKind] = {name: _HERE.get(name) or find_step(name) for name in _NAMES}
