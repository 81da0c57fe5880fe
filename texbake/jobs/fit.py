"""Whether two meshes fit: before the work on them begins, and after most rays missed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.baking.parts.high_parts import match_objects
from texbake.baking.parts.options import PartsOptions
from texbake.baking.report import BakeReport
from texbake.baking.result import BakeResult
from texbake.errors import MeshError
from texbake.mesh.mesh import Mesh
from texbake.mesh.streamed.mesh import StreamedMesh

# Share of the smaller diagonal. Meshes whose boxes differ by no more need no closer look.
_NEAR = 0.02
_MOST_MISSED = 50.0  # percent of the texels
_FEW_MISSED = 0.1  # single texels at the edges of charts


def check_fit(high: Mesh, low: Mesh, *, threads: int | None = None) -> None:
    """Raise where a low-poly mesh fits only once it is scaled, rotated or moved.

    Raises
    ------
    MeshError
        As `stop_at_misfit` does.
    """
    limit = _NEAR * min(high.diagonal, low.diagonal)
    if (np.abs(high.bounds - low.bounds) <= limit).all():
        return
    # Loaded only here, because most pairs need none of it.
    from texbake.checks.misfit import stop_at_misfit

    stop_at_misfit(high, low, threads=threads)


def why_rays_would_miss(
    high: Mesh, low: Mesh, *, orientation: str, threads: int | None = None
) -> tuple[str, ...]:
    """Say in the words of `check` that two meshes face opposite ways; nothing if they do not.

    What faces inwards of the high-poly mesh counts as turned over, if `orientation` is auto.
    """
    from texbake.checks.misfit import why_rays_pass
    from texbake.raycast.orient import oriented

    high, _ = oriented(high, orientation, threads=threads)
    return why_rays_pass(high, low, threads=threads)


def why_missed(
    high: Mesh | StreamedMesh, low: Mesh, report: BakeReport, *, join_objects: bool = False
) -> tuple[str, ...]:
    """Say why rays of a bake missed, in the words of `check`; nothing if hardly any did.

    What faces inwards of the high-poly mesh was turned over for the bake, and is here. The low-poly
    mesh is not: the maps would be those of another mesh than the one in its file, with other
    normals and mirrored charts, and a bake writes no meshes.

    Raises
    ------
    MeshError
        The meshes face opposite ways, and `orientation` is not `keep`, which bakes them as they
        are.
    """
    if isinstance(high, StreamedMesh) or report.miss_percent <= _FEW_MISSED:
        return ()
    from texbake.checks.misfit import why_apart

    orientation, threads = report.options.orientation, report.options.threads
    why = why_rays_would_miss(high, low, orientation=orientation, threads=threads)
    if why and orientation != "keep" and report.miss_percent > _MOST_MISSED:
        raise MeshError(f"{why[0]} `orientation` keep bakes it as it is")
    if why or (why := why_apart(high, low, threads=threads)):
        return why
    if report.cage is not None:
        return (
            f"{report.cage}: the cage lies on the wrong side of the high-poly surface there, or "
            f"rays end before it, {report.back:.4g} behind {low.name}; make a cage with: texbake "
            "cage",
        )
    if not report.measured:
        return (
            f"front, back: {low.name} lies near the high-poly surface, but with these distances "
            "rays end before it or start behind it; leave both out, and they are measured",
        )
    if join_objects:
        return (
            f"join_objects: objects of {low.name} that touch share normals and ray distances; "
            "leave it out, and each has its own",
        )
    if not report.n_objects and len(set(low.group_objects)) > 1:
        return (
            f"{low.name}: where objects touch, rays of one meet the others; give the objects of "
            "both meshes the same names, and each is baked from its own",
        )
    return ()


def explained(
    high: Mesh | StreamedMesh, low: Mesh, baked: BakeResult, *, join_objects: bool
) -> BakeResult:
    """Return a bake whose report says why rays missed, and what objects could be baked apart.

    Raises as `why_missed` does.
    """
    why = why_missed(high, low, baked.report, join_objects=join_objects)
    if not baked.report.n_objects:
        why += why_not_apart(high, low)
    return replace(baked, report=replace(baked.report, why_missed=why))


def why_not_apart(high: Mesh | StreamedMesh, low: Mesh) -> tuple[str, ...]:
    """Say if each object could be baked from the one with its name, and is baked from all."""
    if isinstance(high, StreamedMesh) or not match_objects([high], [low], PartsOptions()):
        return ()
    return (
        f"the objects of {low.name} have the names of those of {high.name}, but the rays of each "
        "may hit any of them; to bake each from its own, use texbake bake without `hits`, `html`, "
        "`time_budget` and `max_memory`",
    )
