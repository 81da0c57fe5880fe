"""Whether two meshes fit: before the work on them begins, and after most rays missed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from texbake.baking.parts.high_parts import match_objects
from texbake.baking.parts.matching import PartsOptions
from texbake.baking.report import BakeReport
from texbake.baking.result import BakeResult
from texbake.errors import MeshError
from texbake.mesh.mesh import Mesh
from texbake.mesh.streamed.mesh import StreamedMesh

if TYPE_CHECKING:
    from texbake.checks.pair import MeshPair

# Share of the smaller diagonal. Meshes whose boxes differ by no more need no closer look.
_NEAR = 0.02
_MOST_MISSED = 50.0  # percent of the texels
_FEW_MISSED = 0.1  # single texels at the edges of charts


def check_fit(high: Mesh, low: Mesh, *, threads: int | None = None) -> None:
    """Raise where a low-poly mesh fits only once it is scaled, rotated or moved."""
    limit = _NEAR * min(high.diagonal, low.diagonal)
    if (np.abs(high.bounds - low.bounds) <= limit).all():
        return
    # Loaded only here, because most pairs need none of it.
    from texbake.checks.pair import require_alignment

    require_alignment(high, low, threads=threads)


def diagnose_opposite_sides(
    high: Mesh, low: Mesh, *, orientation: str, threads: int | None = None
) -> tuple[str, ...]:
    """Say in the words of `check` that meshes, once oriented, face opposite ways, or nothing."""
    from texbake.checks.pair import explain_opposite_sides

    return explain_opposite_sides(_flipped_pair(high, low, orientation, threads))


def _flipped_pair(high: Mesh, low: Mesh, orientation: str, threads: int | None) -> MeshPair:
    from texbake.checks.pair import MeshPair
    from texbake.raycast.orientation import oriented

    high, _ = oriented(high, orientation, threads=threads)
    return MeshPair.of(high, low, threads=threads)


def diagnose_misses(
    high: Mesh | StreamedMesh, low: Mesh, report: BakeReport, *, join_objects: bool = False
) -> tuple[str, ...]:
    """Say why rays of a bake missed, in the words of `check`; nothing if hardly any did.

    Parts of the high-poly mesh that face inwards are flipped, as for the bake; the low-poly mesh is
    not.
    """
    if isinstance(high, StreamedMesh) or report.miss_percent <= _FEW_MISSED:
        return ()
    from texbake.checks.pair import explain_misalignment, explain_opposite_sides

    orientation = report.options.orientation
    pair = _flipped_pair(high, low, orientation, report.options.threads)
    why = explain_opposite_sides(pair)
    if why and orientation != "keep" and report.miss_percent > _MOST_MISSED:
        raise MeshError(f"{why[0]} `orientation` keep bakes it as it is")
    if why or (why := explain_misalignment(pair)):
        return why
    if report.cage is not None:
        return (
            f"{report.cage}: where rays missed, the cage is below the high-poly surface, or rays "
            f"end {report.back:.4g} behind {low.name}, before they reach that surface; make a cage "
            "with: texbake cage",
        )
    if not report.measured:
        return (
            f"front, back: {low.name} is close to the high-poly surface, but with these distances "
            "rays start behind that surface or end before they reach it; leave both out, and "
            "texbake measures them",
        )
    if join_objects:
        return (
            f"join_objects: objects of {low.name} that touch share normals and ray distances; "
            "leave out this option, and each object has its own",
        )
    if not report.n_objects and len(set(low.group_objects)) > 1:
        return (
            f"{low.name}: where objects touch, rays of one object hit another; give the objects of "
            "both meshes the same names, and texbake bakes each object from its match",
        )
    return ()


def with_diagnosis(
    high: Mesh | StreamedMesh, low: Mesh, baked: BakeResult, *, join_objects: bool
) -> BakeResult:
    """Add to a report why rays missed, and which objects could be baked separately."""
    why = diagnose_misses(high, low, baked.report, join_objects=join_objects)
    if not baked.report.n_objects:
        why += unmatched_objects_note(high, low)
    return replace(baked, report=replace(baked.report, why_missed=why))


def unmatched_objects_note(high: Mesh | StreamedMesh, low: Mesh) -> tuple[str, ...]:
    """Say that objects are baked from all objects, if each has a match of its own."""
    if isinstance(high, StreamedMesh) or not match_objects([high], [low], PartsOptions()):
        return ()
    return (
        f"the objects of {low.name} and {high.name} have the same names, but rays can hit any "
        "object; to bake each object from its match, use texbake bake without `hits`, `html`, "
        "`time_budget` and `max_memory`",
    )
