"""A preflight of one mesh, or of a dense and a light one: all checks in their order."""

from __future__ import annotations

from collections.abc import Iterable

from texbake.checks import (
    coordinates,
    crossings,
    shading,
    surface,
    winding,
)
from texbake.checks.finding import Finding, found
from texbake.checks.kinds import KINDS
from texbake.checks.options import SEVERITIES, CheckOptions
from texbake.checks.pair import Pair, pair_findings
from texbake.checks.report import CheckReport
from texbake.checks.subject import Subject
from texbake.checks.texels import Owners, texel_findings, texel_owners
from texbake.checks.walls import wall_findings
from texbake.errors import FileFormatError, MeshError
from texbake.files import PathLike
from texbake.mapping.areas import has_measurable_uvs
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages

_SURFACE_CHECKS = (
    *surface.CHECKS,
    crossings.self_intersections,
    *winding.CHECKS,
    *shading.CHECKS,
)


def check(
    mesh: Mesh,
    low: Mesh | None = None,
    options: CheckOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> CheckReport:
    """Name what will go wrong in a bake before it does.

    Parameters
    ----------
    mesh
        By itself it is checked as a light mesh, or as a dense one if it has no texture
        coordinates; with `low`, as the dense mesh.
    low
        The light mesh that is to be baked to.
    options
        The bake that it is for; None for `CheckOptions()`.
    progress
        Told of the stages.

    Returns
    -------
    CheckReport
        The same for any number of threads.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> turned = plane().replace(uvs=[[1, 0], [0, 0], [1, 1], [0, 1]])
    >>> [finding.name for finding in check(turned).findings]
    ['mirrored-coordinates', 'no-normals']
    """
    options = options or CheckOptions()
    if low is not None:
        return _check(low, mesh, options, [], Stages(progress))
    if mesh.uvs is not None:
        return _check(mesh, None, options, [], Stages(progress))
    return _check(None, mesh, options, [], Stages(progress))


def check_files(
    mesh: PathLike,
    low: PathLike | None = None,
    options: CheckOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> CheckReport:
    """Read and check one mesh or two; a file that holds no mesh is a finding.

    Parameters
    ----------
    mesh, low, options, progress
        As for `check`, but paths.

    Raises
    ------
    FileError
        A file is missing or cannot be read.
    """
    options = options or CheckOptions()
    paths = [mesh] if low is None else [mesh, low]
    roles = ["light"] if low is None else ["dense", "light"]
    read: dict[str, Mesh] = {}
    unreadable = []
    for role, path in zip(roles, paths, strict=True):
        try:
            read[role] = read_mesh(path, progress=progress)
        except (FileFormatError, MeshError) as error:
            unreadable.append(found("unreadable", role, 1, message=str(error)))
    if low is None and "light" in read and read["light"].uvs is None:
        read = {"dense": read["light"]}
    stages = Stages(progress)
    return _check(read.get("light"), read.get("dense"), options, unreadable, stages)


def _check(
    light: Mesh | None,
    dense: Mesh | None,
    options: CheckOptions,
    before: Iterable[Finding | None],
    stages: Stages,
) -> CheckReport:
    findings = list(before)
    light_subject = dense_subject = owners = None
    if dense is not None:
        with stages.stage("check dense mesh"):
            dense_subject = Subject(dense, "dense", options)
            findings += [look(dense_subject) for look in _SURFACE_CHECKS]
    if light is not None:
        with stages.stage("check light mesh"):
            light_subject = Subject(light, "light", options)
            findings += [look(light_subject) for look in _SURFACE_CHECKS]
            more, owners = _coordinate_findings(light_subject)
            findings += more
    if light_subject is not None and dense_subject is not None:
        with stages.stage("compare both"):
            pair = Pair(light_subject, dense_subject)
            findings += pair_findings(pair, owners)
            if not (pair.apart or pair.opposite):
                findings += wall_findings(pair)
    return CheckReport(
        light=light,
        dense=dense,
        options=options,
        findings=_most_severe_first(findings),
        stages=stages.records,
    )


def _coordinate_findings(subject: Subject) -> tuple[list[Finding | None], Owners | None]:
    """What only a light mesh can have, and which of its faces own which texels."""
    if not subject.has_coordinates:
        return [found("no-coordinates", subject.role, 1)], None
    if not has_measurable_uvs(subject.mesh):  # all that can be told is that they are far
        return [coordinates.outside_tile(subject)], None
    owners = texel_owners(subject)
    looks = (*coordinates.CHECKS, *shading.LIGHT_CHECKS)
    return [*(look(subject) for look in looks), *texel_findings(subject, owners)], owners


def _most_severe_first(findings: Iterable[Finding | None]) -> tuple[Finding, ...]:
    """By severity, then as kinds are listed, the light mesh before the dense one."""
    order = list(KINDS)
    there = [finding for finding in findings if finding is not None]
    there.sort(key=lambda f: (SEVERITIES.index(f.severity), order.index(f.name), f.mesh == "dense"))
    return tuple(there)
