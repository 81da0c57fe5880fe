"""Charts between marked seams: each piece is flattened whole, and cut further only if necessary.

A piece keeps its existing layout, which a person made, if the layout is good enough to be relaxed.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from texbake.errors import UnwrapError, UvError, counted
from texbake.mapping.atlas.charts import Charts, ChartSurface, existing_charts, gather_charts
from texbake.mapping.atlas.cutting.cut import cut_charts
from texbake.mapping.atlas.cutting.parts import MOST_MARKED, connected_parts
from texbake.mapping.atlas.cutting.repair import repair_charts
from texbake.mapping.atlas.flatten import relax_charts
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import IntArray, Mesh


def marked_charts(mesh: Mesh, surface: ChartSurface, options: UnwrapOptions) -> Charts:
    """Flatten what lies between the seams of a surface, in units of its points."""
    corners = surface.points[mesh.faces]
    solid = (corners != np.roll(corners, 1, axis=1)).any(axis=2).all(axis=1)
    pieces_of = connected_parts(surface.opposite(solid))
    kept = None
    if options.keep_seams and mesh.uvs is not None:
        kept = _relaxed_layouts(mesh, surface, pieces_of, (options.width_px, options.height_px))
    if kept is None:
        charts = cut_charts(mesh, surface)
    else:
        pieces = [kept]
        left = np.delete(np.arange(mesh.n_faces, dtype=np.int32), kept[0])
        if len(left):
            part = surface.part(left)
            others = Mesh(
                positions=mesh.positions, faces=part.faces, polygon_of=part.polygons, name=mesh.name
            )
            with suppress(UnwrapError):  # none of them has an area
                pieces.append((left, cut_charts(others, part)))
        charts = gather_charts(mesh.faces, pieces)
    n_pieces = len(np.unique(pieces_of[charts.solid]))
    if charts.n_charts <= n_pieces:
        return charts
    note = (
        f"the marked seams leave {counted(n_pieces, 'piece')}, which became {charts.n_charts} "
        "charts: some pieces needed further cuts to be laid flat without overlaps"
    )
    return replace(charts, notes=(*charts.notes, note))


def _relaxed_layouts(
    mesh: Mesh, surface: ChartSurface, pieces_of: IntArray, size: tuple[int, int]
) -> tuple[IntArray, Charts] | None:
    """Relax pieces (F,) without overlaps and mirrored faces; return faces and charts, or None."""
    try:
        existing = existing_charts(mesh, size, regions=pieces_of)
    except UvError:  # the layout has no area
        return None
    fit = repair_charts(
        surface.points[mesh.faces],
        existing.faces,
        existing.uvs,
        existing.chart_ids,
        most_stretch=MOST_MARKED,
    )
    if fit is None:
        return None
    solid = np.flatnonzero(fit.solid)
    before = existing.chart_ids[existing.faces[solid, 0]]
    after = fit.chart_ids[fit.faces[solid, 0]]
    pairs = np.unique(np.stack([before, after], axis=1), axis=0)
    is_whole = np.bincount(pairs[:, 0], minlength=existing.n_charts) == 1
    face_ids = solid[is_whole[before]].astype(np.int32)
    if not len(face_ids):
        return None
    kept, faces = np.unique(fit.faces[face_ids], return_inverse=True)
    charts = Charts(
        uvs=fit.uvs[kept],
        faces=faces.reshape(-1, 3).astype(np.int32),
        chart_ids=np.unique(fit.chart_ids[kept], return_inverse=True)[1].astype(np.int32),
        n_mirrored=fit.n_mirrored,
    )
    return face_ids, relax_charts(surface.part(face_ids), charts)
