"""An atlas in which nearly all of a mesh owns texels: with less padding, or larger, if need be."""

from __future__ import annotations

from dataclasses import replace

from texbake.baking.result import MOST_WITHOUT_TEXEL, unseen_faces
from texbake.baking.texels import SampleGrid, rasterize_uv, snap_uvs
from texbake.errors import UnwrapError, UvError
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.unwrap import UnwrapReport, unwrap_with_report
from texbake.mesh.mesh import Mesh
from texbake.progress import Progress

_GREATEST = 8192
_LEAST_PADDING = 1


def share_without_texel(mesh: Mesh, size: tuple[int, int], *, threads: int | None = None) -> float:
    """Share of a mesh's area whose faces own no texel of a texture of a width and height."""
    grid = SampleGrid(*size, 1)
    owners, _ = rasterize_uv(snap_uvs(mesh, grid), grid, threads=threads)
    areas = surface_areas(mesh.positions[mesh.faces])
    return float(areas[unseen_faces(mesh.n_faces, owners)].sum()) / (float(areas.sum()) or 1.0)


def unwrap_to_fit(
    mesh: Mesh,
    options: UnwrapOptions,
    *,
    may_grow: bool,
    threads: int | None = None,
    progress: Progress = None,
) -> tuple[Mesh, UnwrapReport, tuple[str, ...]]:
    """Unwrap a mesh so that 99 % of its area owns texels, or raise `UvError`; note what it took."""
    padding, asked = options.padding, (options.width_px, options.height_px)
    charted: Mesh | None = None
    failure: UnwrapError | None = None
    for times in (1, 2, 4, 8):
        sides = asked[0] * times, asked[1] * times
        if max(sides) > max(_GREATEST, *asked):
            break
        for room in (padding,) if padding is not None else (None, _LEAST_PADDING):
            chosen = replace(options, size=sides, padding=room)
            if charted is not None:  # its charts stay, and are only packed again
                chosen = replace(chosen, keep=True, seams_at_hard_edges=False)
            try:
                made, report = unwrap_with_report(
                    charted or mesh, options=chosen, threads=threads, progress=progress
                )
            except UnwrapError as error:
                failure = error
                continue
            charted = made
            if share_without_texel(made, sides, threads=threads) > MOST_WITHOUT_TEXEL:
                continue
            if times > 1 and not may_grow:
                less = " or less `padding`" if (padding or 0) > 1 else ""
                raise UvError(
                    f"{mesh.name}: more than a hundredth of its area would own no texel at "
                    f"{asked[0]} x {asked[1]}; use `size` {sides[0]}x{sides[1]}{less}"
                )
            if times == 1:
                return made, report, ()
            note = (
                f"{mesh.name}: its {report.n_charts:,} charts do not fit {asked[0]} x {asked[1]}; "
                f"the images have {sides[0]} x {sides[1]} texels"
            )
            return made, report, (note,)
    if charted is None and failure is not None:
        raise failure
    raise UvError(
        f"{mesh.name}: more than a hundredth of its area would own no texel, even at "
        f"{_GREATEST} x {_GREATEST}; use fewer triangles"
    )
