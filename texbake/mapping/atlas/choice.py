"""Candidates of `best`: the charts of `good`, whole bodies, and few charts with some stretch.

One cost compares all candidates, so that `best` never costs more than `good`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import Charts, ChartSurface, gather_charts
from texbake.mapping.atlas.cutting.body import flatten_body
from texbake.mapping.atlas.cutting.parts import connected_parts, split_parts
from texbake.mapping.atlas.cutting.pockets import close_mouths, find_pockets
from texbake.mapping.atlas.cutting.repair import repair_charts
from texbake.mapping.atlas.flatten import face_energies, relax_charts
from texbake.mapping.atlas.halves import Halves
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.necks import divide_at_necks
from texbake.mapping.atlas.joining.pieces import charts_of, pieces_of
from texbake.mapping.atlas.joining.straighten import straighten_charts
from texbake.mapping.atlas.mirrored_charts import find_counterparts
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.seams import seam_length
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.symmetry import MirrorPlane
from texbake.parallel import run_bands

# Least and most faces of a body, and its least share of the area of the mesh.
_LEAST_FACES, _MOST_FACES, _LEAST_SHARE = 100, 100_000, 0.02
# Most energy of a body as one chart, as a multiple of the minimum; other bodies are cut otherwise.
_MOST_ENERGY = 1.3
# What joining parts of bodies again may add to the mean of L2² and to the empty area, as a share of
# the area of the mesh; and most of the area for a joined part.
_MORE_EXCESS, _MORE_WASTE, _JOINED_SHARE = 0.03, 0.02, 0.25
# Least empty area that cutting off a limb saves, by candidate, in units of the length of the cut
# times the side of a square as large as the mesh.
_GAINS = (0.25, 0.12, 0.06, 0.03)

# Most distance of the center of a symmetric body from the mirror plane, as a share of its extent.
_EVEN = 0.05

# See `layout_cost`.
_OUTLINE, _ENERGY_POWER, _FILL_POWER, _CHARTS_POWER = 1.0, 8.0, 3.0, 0.125


def layout_cost(
    meshes: Sequence[Mesh],
    all_charts: Sequence[Charts],
    all_weights: Sequence[FloatArray],
    fill: float,
) -> float:
    """The cost that `best` keeps low: (seams + 1) · energy⁸ · charts^⅛ / fill³.

    Seams are measured in sides of a square as large as the surface, times `all_weights`, for each
    mesh (F, 3), and the symmetric Dirichlet energy in units of its least value.
    """
    seams = area = energy = 0.0
    n_charts = 0
    for mesh, charts, weights in zip(meshes, all_charts, all_weights, strict=True):
        solid = charts.solid
        corners = mesh.positions[mesh.faces[solid]]
        areas = surface_areas(corners)
        uvs = charts.uvs[charts.faces[solid]]
        flat = float(np.abs(signed_areas(uvs)).sum())
        if flat > 0.0:
            uvs = uvs * math.sqrt(float(areas.sum()) / flat)
        energy += float((face_energies(corners, uvs) * areas).sum())
        area += float(areas.sum())
        laid = mesh.replace(uvs=charts.uvs, uv_faces=charts.faces)
        seams += seam_length(laid, solid, np.where(np.isfinite(weights), weights, 1.0))
        n_charts += charts.n_charts
    if not (area > 0.0 and fill > 0.0):
        return math.inf
    cost = seams / math.sqrt(area) + _OUTLINE
    cost *= float(pm.power(energy / area, _ENERGY_POWER) * pm.power(n_charts, _CHARTS_POWER))
    return cost / float(pm.power(fill, _FILL_POWER))


def whole_bodies(
    surface: ChartSurface, others: Charts, weights: FloatArray, halves: Halves | None = None
) -> list[Charts]:
    """Charts of whole bodies, from candidate to candidate with more limbs cut off.

    Pockets are bodies of their own. Other faces keep their charts, `others`; the list is empty if
    there is no body. `weights` (F, 3): costs of seams along edges; `halves`: of a symmetric mesh,
    whose seams mirror each other.
    """
    corners, solid, opposite = surface.joints
    pockets = find_pockets(surface, weights)
    is_mouth = (opposite >= 0) & (np.repeat(pockets, 3) != pockets[opposite // 3])
    opposite = np.where(is_mouth, np.int32(-1), opposite)
    labels = np.where(solid & others.solid, connected_parts(opposite), -1)
    areas = surface_areas(surface.points[corners])
    least = _LEAST_SHARE * float(areas[labels >= 0].sum())
    parts = [
        part
        for part in split_parts(opposite, labels)
        if pockets[part.face_ids[0]] > 0
        or (
            _LEAST_FACES <= len(part.face_ids) <= _MOST_FACES
            and areas[part.face_ids].sum() >= least
        )
    ]
    found: list[Charts | None] = [None] * len(parts)

    def lay(first: int, last: int) -> None:
        for number in range(first, last):
            part = parts[number]
            own = surface.points[corners[part.face_ids]]
            mouths = is_mouth.reshape(-1, 3)[part.face_ids].ravel()
            if pockets[part.face_ids[0]] > 0:  # it opens at its own mouth
                mouths[:] = False
            closed = close_mouths(own, part.opposite, weights[part.face_ids].ravel(), mouths)
            laid = flatten_body(*closed, _plane_of(own, halves), n_faces=len(own))
            if laid is not None and laid.flat.energy <= 4.0 * _MOST_ENERGY:
                found[number] = laid.charts()

    run_bands(lay, len(parts), band=1, threads=surface.threads)
    pieces = [
        (part.face_ids, charts)
        for part, charts in zip(parts, found, strict=True)
        if charts is not None
    ]
    if not pieces:
        return []
    charts = gather_charts(surface.faces, [*pieces, *_left_over(others, pieces)])
    return _cut_off(surface, charts, weights, halves)


def _plane_of(corners: FloatArray, halves: Halves | None) -> MirrorPlane | None:
    """The mirror plane, if faces with these corners (m, 3, 3) lie evenly about it."""
    if halves is None:
        return None
    areas, heights = surface_areas(corners), halves.plane.heights(corners.mean(axis=1))
    mean = float((areas * heights).sum() / areas.sum())
    return halves.plane if abs(mean) <= _EVEN * float(np.ptp(heights)) else None


def _left_over(
    charts: Charts, pieces: Sequence[tuple[IntArray, Charts]]
) -> list[tuple[IntArray, Charts]]:
    """The faces of charts that are in none of the pieces, with their charts."""
    is_left = charts.solid
    for face_ids, _ in pieces:
        is_left[face_ids] = False
    left = np.flatnonzero(is_left).astype(np.int32)
    if not len(left):
        return []
    kept, faces = np.unique(charts.faces[left], return_inverse=True)
    part = Charts(
        uvs=charts.uvs[kept],
        faces=faces.reshape(-1, 3).astype(np.int32),
        chart_ids=np.unique(charts.chart_ids[kept], return_inverse=True)[1].astype(np.int32),
    )
    return [(left, part)]


def _cut_off(
    surface: ChartSurface, charts: Charts, weights: FloatArray, halves: Halves | None
) -> list[Charts]:
    """Charts without overlaps, with more and more limbs cut off."""
    opposite = surface.opposite(charts.solid)
    pieces = pieces_of(surface, charts, opposite)
    side = math.sqrt(math.fsum(piece.area for piece in pieces))
    plane = None if halves is None else halves.plane
    found: list[Charts] = []
    for gain in _GAINS:
        n_before = len(pieces)
        pieces = divide_at_necks(pieces, opposite, weights, least_gain=gain, side=side, plane=plane)
        if not found or len(pieces) > n_before:
            found.append(_joined_again(surface, charts_of(pieces, charts), weights, halves))
    return found


def _joined_again(
    surface: ChartSurface, charts: Charts, weights: FloatArray, halves: Halves | None
) -> Charts:
    """Charts relaxed and without overlaps, joined at edges other than those cut, straightened."""

    def pairs(faces: list[IntArray]) -> dict[int, int]:
        return {} if halves is None else find_counterparts(faces, surface, halves)

    charts = _parted(surface, relax_charts(surface, charts))
    if charts.n_charts > 1:
        pieces = pieces_of(surface, charts, surface.opposite(charts.solid))
        area = math.fsum(piece.area for piece in pieces)
        excess, waste = (
            math.fsum(getattr(piece, name) for piece in pieces) / area
            for name in ("excess", "waste")
        )
        charts = join_charts(
            surface,
            charts,
            weights=weights,
            most_l2=math.sqrt(1.0 + excess + _MORE_EXCESS),
            most_share=_JOINED_SHARE,
            most_waste=waste + _MORE_WASTE,
            find_counterparts=pairs,
        )
    straight = straighten_charts(surface, charts, weights, halves=halves, find_counterparts=pairs)
    return _parted(surface, straight)


def _parted(surface: ChartSurface, charts: Charts) -> Charts:
    """Charts whose faces that overlap others of their chart are split off."""
    solid = np.flatnonzero(charts.solid).astype(np.int32)
    corners = surface.points[surface.faces[solid]]
    parted = repair_charts(corners, charts.faces[solid], charts.uvs, charts.chart_ids, even=False)
    return charts if parted is None else gather_charts(surface.faces, [(solid, parted)])
