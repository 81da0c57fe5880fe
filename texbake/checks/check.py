"""The check before a bake of one mesh, or of a high-poly and a low-poly mesh, and its report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, field, replace
from typing import Any

import numpy as np

from texbake.checks import coordinates, orientation, surface
from texbake.checks.bake_kinds import FACES, SEVERITIES
from texbake.checks.budget import AssetFile, budget_findings
from texbake.checks.checked_mesh import CheckedMesh, Finding, make_finding
from texbake.checks.coordinates import texel_findings, texel_owners
from texbake.checks.kinds import KINDS, CheckOptions
from texbake.checks.pair import (
    MeshPair,
    detail_below_texels,
    distances,
    high_is_coarser,
    misalignment,
    opposite_sides,
)
from texbake.checks.walls import wall_findings
from texbake.errors import FileError, FileFormatError, MeshError, OptionError
from texbake.files import PathLike
from texbake.mapping.corner_uvs import has_measurable_uvs
from texbake.mesh.files import read_mesh
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Float32Array, IntArray, Mesh
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckReport:
    """Everything that a check found."""

    low: Mesh | None  # the meshes that were checked
    high: Mesh | None
    options: CheckOptions
    findings: tuple[Finding, ...]  # the most severe first, then those that are allowed
    stages: list[StageRecord]
    files: dict[str, str] = field(default_factory=dict)  # paths of `low` and `high`, where known

    def count(self, severity: str) -> int:
        """Return how many findings have a severity and are not allowed."""
        return sum(
            finding.severity == severity and not finding.allowed for finding in self.findings
        )

    @property
    def n_allowed(self) -> int:
        """How many findings the options accept."""
        return sum(finding.allowed for finding in self.findings)

    def fails(self, severity: str = "error") -> bool:
        """Whether any finding that is not allowed is as severe as this, or more severe."""
        if severity not in SEVERITIES:
            raise OptionError(f"severity: {severity} is not one of {', '.join(SEVERITIES)}")
        return any(self.count(known) for known in SEVERITIES[: SEVERITIES.index(severity) + 1])

    def finding(self, name: str) -> Finding | None:
        """Return the first finding of a kind, or None."""
        return next((finding for finding in self.findings if finding.name == name), None)

    def file_of(self, finding: Finding | None) -> str:
        """Return the path of the mesh of a finding, or of what is checked, or else its name."""
        last = "low" if self.low is not None or "low" in self.files else "high"
        role = last if finding is None else finding.mesh
        mesh = self.low if role == "low" else self.high
        return self.files.get(role) or ("mesh" if mesh is None else mesh.name)

    @property
    def has_layout(self) -> bool:
        """Whether the low-poly mesh has texture coordinates that can be drawn."""
        low = self.low
        return low is not None and low.uvs is not None and has_measurable_uvs(low)

    @property
    def seconds(self) -> float:
        """Time that all stages took."""
        return sum(stage.seconds for stage in self.stages)

    def to_json(self) -> dict[str, Any]:
        """Return all of it as plain values, for `json.dump`."""
        return {
            **{
                role: None if mesh is None else {"name": mesh.name, "n_faces": mesh.n_faces}
                for role, mesh in (("low", self.low), ("high", self.high))
            },
            "options": asdict(self.options),
            "n_errors": self.count("error"),
            "n_warnings": self.count("warning"),
            "n_notes": self.count("note"),
            "n_allowed": self.n_allowed,
            "findings": [finding.to_json() for finding in self.findings],
            "stages": [asdict(stage) for stage in self.stages],
        }

    def picture(self, size: int = 640) -> Float32Array:
        """(H, W, 3) linear picture of a UV layout for each finding, `size` pixels long."""
        from texbake.checks.picture import draw_findings

        return draw_findings(self, size)


_SURFACE_CHECKS = (
    *surface.CHECKS,
    surface.self_intersections,
    *orientation.WINDING_CHECKS,
    *orientation.NORMAL_CHECKS,
)


def check(
    mesh: MeshLike,
    low: MeshLike | None = None,
    options: CheckOptions | None = None,
    *,
    progress: Progress = None,
) -> CheckReport:
    """Check meshes before a bake, and report what will go wrong.

    Parameters
    ----------
    mesh
        The high-poly mesh, where `low` is given. A mesh on its own is checked as a low-poly mesh,
        or as a high-poly mesh if it has no texture coordinates.
    low
        The low-poly mesh to bake to.
    options
        The bake to check for; None for `CheckOptions()`.
    progress
        Receives the stages.

    Returns
    -------
    CheckReport
        The same for any number of threads.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> mirrored = plane().replace(uvs=[[1, 0], [0, 0], [1, 1], [0, 1]])
    >>> [finding.name for finding in check(mirrored).findings]
    ['mirrored-coordinates', 'no-normals']
    """
    mesh = as_mesh(mesh)
    low = None if low is None else as_mesh(low)
    options = options or CheckOptions()
    if low is None and mesh.uvs is not None:
        return _check(mesh, None, options, [], Stages(progress))
    return _check(low, mesh, options, [], Stages(progress))


def check_files(
    mesh: PathLike,
    low: PathLike | None = None,
    options: CheckOptions | None = None,
    *,
    missing: bool = False,
    progress: Progress = None,
) -> CheckReport:
    """Read and check meshes; a damaged one is a finding, and with `missing` so is an absent one."""
    options = options or CheckOptions()
    paths = [mesh] if low is None else [mesh, low]
    roles = ["low"] if low is None else ["high", "low"]
    read: dict[str, Mesh] = {}
    unreadable = []
    for role, path in zip(roles, paths, strict=True):
        try:
            read[role] = read_mesh(path, progress=progress)
        except (FileError, MeshError) as error:
            if not (missing or isinstance(error, (FileFormatError, MeshError))):
                raise
            unreadable.append(make_finding("unreadable", role, 1, message=str(error)))
    if low is None and "low" in read and read["low"].uvs is None:
        read, roles = {"high": read["low"]}, ["high"]
    asset = AssetFile.of(paths[-1]) if options.profile and roles[-1] in read else None
    report = _check(read.get("low"), read.get("high"), options, unreadable, Stages(progress), asset)
    return replace(report, files={role: str(path) for role, path in zip(roles, paths, strict=True)})


def _check(
    low: Mesh | None,
    high: Mesh | None,
    options: CheckOptions,
    before: Iterable[Finding | None],
    stages: Stages,
    asset: AssetFile | None = None,
) -> CheckReport:
    findings = list(before)
    checked_low = checked_high = owners = None
    if high is not None:
        with stages.stage("check the high-poly mesh"):
            checked_high = CheckedMesh(high, "high", options)
            findings += [look(checked_high) for look in _SURFACE_CHECKS]
    if low is not None:
        with stages.stage("check the low-poly mesh"):
            checked_low = CheckedMesh(low, "low", options)
            findings += [look(checked_low) for look in _SURFACE_CHECKS]
            more, owners = _coordinate_findings(checked_low)
            findings += more
    if checked_low is not None and checked_high is not None:
        with stages.stage("compare both"):
            pair = MeshPair(checked_low, checked_high)
            findings += _pair_findings(pair, owners)
            if not (pair.apart or pair.opposite):
                findings += wall_findings(pair)
    shown = checked_low or checked_high
    if options.profile is not None and shown is not None:
        findings += budget_findings(shown, asset)
    meshes = {"low": low, "high": high}
    there = [finding for finding in findings if finding is not None]
    judged = [_by_polygons(finding, meshes[finding.mesh]) for finding in there]
    judged = [replace(finding, allowed=finding.name in options.allow) for finding in judged]
    return CheckReport(
        low=low,
        high=high,
        options=options,
        findings=_most_severe_first(judged),
        stages=stages.records,
    )


def _pair_findings(pair: MeshPair, owners: IntArray | None) -> list[Finding | None]:
    """All findings about a pair; some of them only where the meshes fit together."""
    results = [high_is_coarser(pair), *misalignment(pair)]
    if not any(finding and finding.severity == "error" for finding in results):
        results += [*distances(pair), opposite_sides(pair)]
    if owners is not None:
        results.append(detail_below_texels(pair, owners))
    return results


def _coordinate_findings(checked: CheckedMesh) -> tuple[list[Finding | None], IntArray | None]:
    """Findings that only a low-poly mesh can have, and which of its faces own which texels."""
    if not checked.has_coordinates:
        return [checked.finding("no-coordinates", 1)], None
    if not has_measurable_uvs(checked.mesh):  # too far away for anything else to be computed
        return [coordinates.outside_tile(checked)], None
    owners = texel_owners(checked)
    looks = (*coordinates.CHECKS, *orientation.LOW_POLY_CHECKS)
    return [*(look(checked) for look in looks), *texel_findings(checked, owners)], owners


def _by_polygons(finding: Finding, mesh: Mesh | None) -> Finding:
    """Return a finding with faces counted as polygons of its mesh."""
    if mesh is None or mesh.polygon_of is None or len(finding.faces) == 0:
        return finding
    numbers = mesh.polygon_of[finding.faces]
    polygons = numbers[np.sort(np.unique(numbers, return_index=True)[1])]
    is_count_of_faces = finding.kind.unit == FACES and finding.count == len(finding.faces)
    count = len(polygons) if is_count_of_faces else finding.count
    return replace(finding, polygons=polygons, count=count)


def _most_severe_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """By severity, then in the order of `KINDS`, the low-poly mesh first; allowed ones last."""
    order = list(KINDS)

    def rank(finding: Finding) -> tuple[bool, int, int, bool]:
        severity = SEVERITIES.index(finding.severity)
        return finding.allowed, severity, order.index(finding.name), finding.mesh == "high"

    return tuple(sorted(findings, key=rank))
