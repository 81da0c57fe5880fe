"""The atlas: the charts of one or several meshes, made and packed into one texture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from texbake.errors import UnwrapError
from texbake.mapping.atlas.charts import (
    Charts,
    border_length,
    enlarged,
    existing_charts,
    find_isolated_faces,
    gather_charts,
    groups_in_use,
    mesh_of,
    single_face_charts,
    tile_groups,
    with_cuts_noted,
    with_shapes_noted,
)
from texbake.mapping.atlas.choice import layout_cost, whole_bodies
from texbake.mapping.atlas.cutting.cut import cut_charts, may_stay_whole, snap_points
from texbake.mapping.atlas.cutting.marked import marked_charts
from texbake.mapping.atlas.flatten import chart_stretch, relax_charts
from texbake.mapping.atlas.halves import Halves
from texbake.mapping.atlas.joining.bound import bound_charts
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.straighten import straighten_charts
from texbake.mapping.atlas.mirrored_charts import (
    find_counterparts,
    half_charts,
    half_faces,
    half_surface,
    stacked_charts,
)
from texbake.mapping.atlas.neighbors import Neighbors, find_neighbors
from texbake.mapping.atlas.packing.pack import Packing, check_tiles, pack_charts, upright_tiles
from texbake.mapping.atlas.rectangles import MOST_L2, tube_charts, with_rectangles
from texbake.mapping.atlas.source import ChartSource
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.options import UnwrapOptions, fitting_padding
from texbake.mesh.compose import offset_joined
from texbake.mesh.frame import snapped
from texbake.mesh.mesh import BoolArray, FloatArray, Mesh
from texbake.mesh.objects import face_objects
from texbake.mesh.topology import face_components
from texbake.progress import Stages
from texbake.records import dataclass

# Most L2 stretch of a mesh after charts are joined, in `fast` as in `good`. With `good`, the part
# above 1 also grows by at most a factor of `_GOOD_ROOM`, or to `_GOOD_LEAST`, which nobody sees.
_GOOD_LEAST, _GOOD_STRETCH = 1.01, 1.03
_GOOD_ROOM, _HALVES_ROOM = 1.5, 2.5  # charts of halves are smaller before they are joined
_BEST_STRETCH = 1.09
# Greatest extent of a joined chart, in sides of a square as large as the charts of a tile. A longer
# one would set the scale of all: charts that fill three quarters of a square have one as long.
_JOINED_SIDES = 1.15
# Limit of the work of joining, which only large noisy scans and meshes of hundreds of charts reach.
_JOIN_WORK = {"fast": 100, "good": 300, "best": 1000}
# By default, `good` joins charts whose seams are not hidden if hidden ones would be longer by this.
_HIDDEN_LENGTH = 1.05
# If whole bodies cost less than this share of the cost of `good`, nothing else is tried.
_CLEARLY_BETTER = 0.7
_NO_TUBES = "no tube is unrolled where seams are marked, faces are protected or halves overlap"
# Steps from zero to the size of the largest of several meshes.
_SIZES = 2.0**40


@dataclass(frozen=True, kw_only=True, eq=False)
class Atlas:
    """Packed coordinates of one mesh."""

    # (F, 3, 2) float64; texture coordinates; UDIM tile k is offset by (k % 10, k // 10).
    corners: FloatArray
    charts: Charts  # the charts before packing
    padding: int  # texels of space around each chart


def make_atlas(
    meshes: Sequence[Mesh],
    options: UnwrapOptions,
    stages: Stages,
    *,
    seams: Sequence[BoolArray | None],
    protected: Sequence[BoolArray | None],
    importance: Sequence[FloatArray | None] | None = None,
    threads: int | None = None,
) -> list[Atlas]:
    """Make the charts of meshes and pack them all into one texture or its tiles.

    `seams`: for each mesh, (F, 3) bool: edges at which charts are cut; None to choose them.
    `protected`: for each mesh, (F,) bool: faces between which no seam may run. `importance`: for
    each mesh, (F,) float64 from 0 to 1.
    """
    importance = importance or [None] * len(meshes)
    if options.by_group:  # fail before the work
        check_tiles(len(groups_in_use(meshes)), options.tiles, _name_of(meshes))
    # With overlap, a whole body has no other half to lie on.
    is_free = options.symmetry != "overlap" and all(each is None for each in (*seams, *protected))
    sources = [
        ChartSource.of_mesh(mesh, options, stages, seams=marked, protected=whole, threads=threads)
        for mesh, marked, whole in zip(meshes, seams, protected, strict=True)
        if not options.keep
    ]
    if options.keep:
        all_charts = [_kept_charts(mesh, options) for mesh in meshes]
    elif options.quality == "best" and options.charts == "texbake" and is_free:
        all_charts = _best_charts(sources, meshes, options, stages, importance, threads)
    else:
        all_charts = [
            _make_charts(source, options, whole)
            for source, whole in zip(sources, protected, strict=True)
        ]
    if options.straighten:
        most = min(MOST_L2, options.max_stretch or MOST_L2)
        with stages.stage("straighten strips"):
            all_charts = [
                with_rectangles(snap_points(mesh), mesh.faces, charts, most, threads=threads)
                for mesh, charts in zip(meshes, all_charts, strict=True)
            ]
    near = find_neighbors(meshes, all_charts, sources, pairs=options.quality == "good")
    return _packed_charts(meshes, all_charts, options, stages, importance, threads, near)[0]


def _kept_charts(mesh: Mesh, options: UnwrapOptions) -> Charts:
    regions = mesh.face_groups if options.by_group else face_objects(mesh)
    return existing_charts(mesh, (options.width_px, options.height_px), regions=regions)


def _best_charts(
    sources: Sequence[ChartSource],
    meshes: Sequence[Mesh],
    options: UnwrapOptions,
    stages: Stages,
    importance: Sequence[FloatArray | None],
    threads: int | None,
) -> list[Charts]:
    """The charts of the least `layout_cost`: of `good`, of whole bodies, or larger ones."""
    good = replace(options, quality="good")
    candidates: list[tuple[float, list[Charts]]] = []

    def consider(all_charts: list[Charts]) -> None:
        with suppress(UnwrapError):  # they do not fit
            _, packing = _packed_charts(meshes, all_charts, good, stages, importance, threads)
            weights = [source.weights for source in sources]
            # At the largest density, tiles that stay empty are wasted.
            fill = packing.fill * (packing.n_tiles if options.texel_density is None else 1)
            cost = layout_cost(meshes, all_charts, weights, fill)
            candidates.append((cost, all_charts))

    of_good = [_make_charts(source, good) for source in sources]
    consider(of_good)
    bodies = [  # would contain tubes that are unrolled
        [] if options.straighten else _body_charts(source, charts, options)
        for source, charts in zip(sources, of_good, strict=True)
    ]
    for number in range(max(map(len, bodies))):
        consider(
            [
                found[min(number, len(found) - 1)] if found else charts
                for found, charts in zip(bodies, of_good, strict=True)
            ]
        )
    least = min((cost for cost, _ in candidates[1:]), default=math.inf)
    if not (candidates and least < _CLEARLY_BETTER * candidates[0][0]):
        consider([_make_charts(source, options) for source in sources])
    return min(candidates, key=lambda each: each[0])[1] if candidates else of_good


def _name_of(meshes: Sequence[Mesh]) -> str:
    return meshes[0].name if len(meshes) == 1 else f"{len(meshes)} meshes"


def _packed_charts(
    meshes: Sequence[Mesh],
    all_charts: list[Charts],
    options: UnwrapOptions,
    stages: Stages,
    importance: Sequence[FloatArray | None],
    threads: int | None,
    neighbors: Neighbors | None = None,
) -> tuple[list[Atlas], Packing]:
    """Pack the charts of meshes, important ones larger."""
    sides = [float((mesh.bounds[1] - mesh.bounds[0]).max()) for mesh in meshes]
    unit = max(sides) or 1.0
    all_charts = [
        enlarged(charts, float(snapped(side / unit, _SIZES)), values)
        for charts, side, values in zip(all_charts, sides, importance, strict=True)
    ]
    size = options.width_px, options.height_px
    padding = options.padding
    if padding is None:
        padding = fitting_padding(size, sum(charts.n_charts for charts in all_charts))
    faces = offset_joined([(charts.packed_faces, len(charts.uvs)) for charts in all_charts])
    chart_ids = offset_joined([(charts.chart_ids, charts.n_charts) for charts in all_charts])
    with stages.stage("pack charts"):
        packing = pack_charts(
            np.concatenate([charts.uvs for charts in all_charts]),
            faces,
            chart_ids,
            size=size,
            padding=padding,
            name=_name_of(meshes),
            effort=options.quality,
            tiles=options.tiles,
            tile_groups=tile_groups(meshes, all_charts) if options.by_group else None,
            density=options.texel_density,
            unit=unit,
            reshape=not options.keep and options.max_stretch is None,
            neighbors=neighbors,
            threads=threads,
        )
    all_charts = with_shapes_noted(all_charts, packing.reshaped)
    of_meshes = zip(meshes, all_charts, strict=True)
    heights = [mesh.positions[charts.packed(mesh.faces), 1] for mesh, charts in of_meshes]
    is_square = size[0] == size[1]
    uvs = upright_tiles(packing, chart_ids, faces, np.concatenate(heights), square=is_square)
    parts = np.split(uvs, np.cumsum([len(charts.uvs) for charts in all_charts])[:-1])
    atlases = [
        Atlas(corners=uvs[charts.faces], charts=charts, padding=padding)
        for uvs, charts in zip(parts, all_charts, strict=True)
    ]
    return atlases, packing


def _make_charts(
    source: ChartSource, options: UnwrapOptions, protected: BoolArray | None = None
) -> Charts:
    """Make the charts of one mesh, in units of the longest side of its bounding box."""
    mesh, surface, stages = source.mesh, source.surface, source.stages
    isolated, others = find_isolated_faces(surface)
    pieces = []
    if len(isolated):
        pieces.append((isolated, single_face_charts(surface.points, mesh.faces[isolated])))
    is_free = surface.seams is None and protected is None and options.symmetry != "overlap"
    if options.straighten and is_free:
        with stages.stage("unroll tubes"):
            tubes = tube_charts(surface, min(MOST_L2, options.max_stretch or MOST_L2))
        others = np.setdiff1d(others, np.concatenate([others[:0], *(ids for ids, _ in tubes)]))
        area = float(surface_areas(surface.points[surface.faces]).sum())
        pieces, surface = pieces + tubes, replace(surface, area=area)
    if not pieces:
        charts = _connected_charts(source, options)
    else:
        if len(others):
            with suppress(UnwrapError):  # none of them has an area
                part = source.part(surface.part(others))
                pieces.append((others, _connected_charts(part, options)))
        charts = gather_charts(mesh.faces, pieces)
    if protected is not None:
        charts = with_cuts_noted(surface, charts, protected, max_stretch=options.max_stretch)
    hard = f"{source.n_within:,} hard edges have no seam, because they end within a chart"
    notes = ((source.n_within, hard), (options.straighten and not is_free, _NO_TUBES))
    return replace(charts, notes=(*charts.notes, *(note for applies, note in notes if applies)))


def _body_charts(source: ChartSource, others: Charts, options: UnwrapOptions) -> list[Charts]:
    """Candidates of charts of whole bodies; `others`: charts, for faces of no body."""
    halves, weights = source.halves, source.weights
    with source.stages.stage("cut bodies"):
        found = whole_bodies(source.surface, others, weights, halves)
    return [replace(_bounded(source, charts, options), notes=others.notes) for charts in found]


def _connected_charts(source: ChartSource, options: UnwrapOptions) -> Charts:
    """Cut, relax and join the charts of a mesh, in units of its points."""
    surface = source.surface
    if surface.seams is not None:
        with source.stages.stage("flatten between seams"):
            between = marked_charts(source.mesh, surface, options)
        return _bounded(source, between, options)
    overlaps = source.symmetry == "overlap"
    why, halves = "it has no mirror plane", None
    is_fast = options.quality == "fast"
    # `fast` cuts mechanical parts along creases, most of which mirror each other anyway.
    if options.charts == "texbake" and (overlaps or not (is_fast and source.is_flat_sided)):
        halves = source.halves
    if halves is not None and overlaps:
        if halves.twins is not None:
            return _stacked_charts(source, halves, options)
        why = "its faces do not mirror each other one by one"
        halves = None if is_fast else halves
    charts: Charts | None = None
    if halves is not None and may_stay_whole(surface, options.quality):
        charts = _cut(source, source.weights, options)
        # Where no chart meets another, there is no border that a mirror image could differ from.
        if charts.n_charts == face_components(surface.corners, len(surface.points))[1]:
            halves = None
    if charts is None or halves is not None:
        charts = _cut_either_way(source, options, halves)
    if halves is not None or not is_fast:
        charts = _improved(source, charts, options, halves)
    elif options.charts == "texbake":
        with source.stages.stage("straighten borders"):
            charts = straighten_charts(source.surface, charts, source.weights, n_rounds=1)
    charts = _bounded(source, charts, options)
    note = (f"no charts share texels, because {why}",) if overlaps else ()
    return replace(charts, notes=(*charts.notes, *note))


def _cut_either_way(
    source: ChartSource, options: UnwrapOptions, halves: Halves | None = None
) -> Charts:
    """The charts of `_cut`, whose seams are hidden unless that makes them much longer."""
    charts, plain = _cut(source, source.weights, options, halves), source.plain_weights
    if options.quality != "good" or plain is None:
        return charts
    others = _cut(source, plain, options, halves)
    surface = source.surface if halves is None else half_surface(source.surface, halves)
    lengths = [border_length(surface, each) for each in (charts, others)]
    return others if lengths[0] > _HIDDEN_LENGTH * lengths[1] else charts


def _cut(
    source: ChartSource, weights: FloatArray, options: UnwrapOptions, halves: Halves | None = None
) -> Charts:
    """Charts before they are joined, by weights (F, 3); of `half_faces` if there are halves."""
    mesh, surface, area = source.mesh, source.apart, source.surface.area
    if halves is not None:
        area = area or float(surface_areas(surface.points[surface.faces]).sum())
        surface, weights = half_surface(surface, halves), weights[half_faces(halves)]
        mesh = mesh_of(mesh, surface)
    with source.stages.stage("cut charts", total=mesh.n_faces, unit="faces") as advance:
        return cut_charts(
            mesh,
            surface,
            weights=weights,
            quality=options.quality,
            method=options.charts,
            area=area,
            timeout=options.timeout,
            advance=advance,
        )


def _stacked_charts(source: ChartSource, halves: Halves, options: UnwrapOptions) -> Charts:
    """Cut one half of a mesh, and lay the other on it."""
    half = source.part(half_surface(source.surface, halves))
    charts = _cut_either_way(half, options)
    if options.quality != "fast":
        charts = _improved(half, charts, options)
    return stacked_charts(halves, _bounded(half, charts, options), source.mesh)


def _bounded(source: ChartSource, charts: Charts, options: UnwrapOptions) -> Charts:
    """Cut charts where the options bound their stretch."""
    if options.max_stretch is None:
        return charts
    with source.stages.stage("bound stretch"):
        return bound_charts(source.surface, charts, max_stretch=options.max_stretch)


def _improved(
    source: ChartSource, charts: Charts, options: UnwrapOptions, halves: Halves | None = None
) -> Charts:
    """Relax or mirror charts, join them as far as stretch allows, and straighten their borders.

    With `fast`, charts are mirrored, and only joined with their mirror images.
    """
    mesh, surface, stages, weights = source.mesh, source.surface, source.stages, source.weights
    is_fast = options.quality == "fast"
    if halves is None:
        as_cut = chart_stretch(surface.points, mesh, charts)
        with stages.stage("relax charts"):
            charts = relax_charts(surface, charts)
    else:
        with stages.stage("mirror charts"):
            charts = half_charts(mesh, surface, halves, charts, weights, options.quality)
        as_cut = chart_stretch(surface.points, mesh, charts)
    allowed = _BEST_STRETCH if options.quality == "best" else _GOOD_STRETCH
    if options.quality == "good":
        room = _GOOD_ROOM if halves is None else _HALVES_ROOM
        allowed = min(max(1.0 + room * (as_cut - 1.0), _GOOD_LEAST), allowed)
    pairs = None if halves is None else partial(find_counterparts, surface=surface, halves=halves)
    with stages.stage("join charts"):
        charts = join_charts(
            source.apart_as(charts),
            charts,
            weights=weights,
            most_l2=allowed,
            most_chart_l2=options.max_stretch,
            most_length=_JOINED_SIDES / math.sqrt(options.tiles),
            most_work=_JOIN_WORK[options.quality] * (1 if halves is None else 2),
            find_counterparts=pairs,
            only_pairs=is_fast,
        )
    if options.charts != "texbake":
        return charts
    with stages.stage("straighten borders"):
        return straighten_charts(
            surface, charts, weights, halves=halves, find_counterparts=pairs,
            n_rounds=1 if is_fast else 2,
        )  # fmt: skip
