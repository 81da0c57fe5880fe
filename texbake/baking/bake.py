"""A dense and a light mesh to maps: the stages of a bake in their order."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.baking.baked_map import BakedMap
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import map_kinds
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.ray_maps import RayMaps
from texbake.baking.rays import check_cage
from texbake.baking.report import BakeReport, DistanceSummary, library_versions
from texbake.baking.result import BakeResult
from texbake.baking.secondary.rays import SecondaryRays
from texbake.baking.sums import TexelSums
from texbake.baking.surround import Surroundings
from texbake.baking.texels import NO_FACE
from texbake.baking.trace import Trace
from texbake.baking.trees import Trees
from texbake.errors import MissError, OptionError, UvError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import IntArray, Mesh
from texbake.progress import ProgressSink, Stages
from texbake.sampling.report import SamplingReport

# Options that belong to a trace, and stay as they were when other maps are made of it.
_OF_TRACE = (
    "size",
    "samples",
    "rays",
    "front",
    "back",
    "cull_back_faces",
    "secondary_rays",
    "occluder_distance",
    "fail_on_miss",
    "keep_hits",
)


def bake(
    high: MeshLike,
    low: MeshLike,
    options: BakeOptions | None = None,
    *,
    cage: MeshLike | None = None,
    materials: Materials | None = None,
    skew_mask: npt.ArrayLike | None = None,
    offset_map: npt.ArrayLike | None = None,
    progress: ProgressSink | None = None,
) -> BakeResult:
    """Carry the detail of a dense mesh over to a light one, as maps.

    Parameters
    ----------
    high
        The dense mesh.
    low
        The light mesh; it needs texture coordinates.
    options
        None for `BakeOptions()`.
    cage
        The light mesh's faces with other positions: rays start on it.
    materials
        Of the dense mesh, for the maps `texture` and `material-id`; see `read_materials`.
    skew_mask : (H, W) floats, optional
        Over the light mesh's texture coordinates: 0 where rays go as `BakeOptions.rays` says, 1
        where they go along the face's normal, between them a blend.
    offset_map : (H, W) floats, optional
        Over the same: what the front distance, or the cage's, is multiplied by, 0 or more.
    progress
        Is told of the stages.

    Returns
    -------
    BakeResult
        The same, byte for byte, for any number of threads.

    Raises
    ------
    UvError
        The light mesh has no texture coordinates, or they cover nothing.
    CageError
        The cage has other faces than the light mesh.
    MeshError
        The meshes are below 1e-30 or above 1e37 model units across, beyond the float32 of maps; or
        the dense mesh lacks what a map is made from.
    MissError
        More texels missed than `options.fail_on_miss` allows.
    OptionError
        A map that is not known; an image with values out of range.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> result = bake(plane(), plane(), BakeOptions(size=16))
    >>> result.maps["normal"].values[8, 8].tolist()
    [0.0, 0.0, 1.0]
    """
    high, low = as_mesh(high), as_mesh(low)
    cage = None if cage is None else as_mesh(cage)
    options = options or BakeOptions()
    kinds = map_kinds(options.maps)
    inputs = BakeInputs(high, low, options, materials)
    check_maps(kinds, inputs)
    if cage is not None:
        check_cage(cage, low)
        if options.front is not None:
            raise OptionError("front, cage: rays start on the cage; give one of the two")
    ray_maps = RayMaps.of(skew_mask, offset_map)
    if options.time_budget is not None:
        return _bake_in_time(kinds, inputs, cage, ray_maps, progress)
    return bake_inputs(kinds, inputs, cage, ray_maps, Stages(progress))


def check_maps(kinds: list[MapKind], inputs: BakeInputs) -> None:
    """Raise where a map cannot be made from what is given."""
    for kind in kinds:
        if kind.require is not None:
            kind.require(inputs)
        if kind.of_misses and (inputs.options.is_adaptive or inputs.options.time_budget):
            raise OptionError(
                f"maps, samples: {kind.name} counts misses among fixed samples; give 1, 4, 16 or "
                "64, or bake it by itself"
            )


def _bake_in_time(
    kinds: list[MapKind],
    inputs: BakeInputs,
    cage: Mesh | None,
    ray_maps: RayMaps | None,
    progress: ProgressSink | None,
) -> BakeResult:
    from texbake.baking.adaptive_texels.budget import plan_bake

    start = time.perf_counter()
    stages = Stages(progress)
    secondary = SecondaryRays.for_maps((kind.needs for kind in kinds), inputs)
    trace = Trace(inputs.high, inputs.low, inputs.options, cage, stages, secondary, ray_maps)
    trees = trace.own_trees()
    try:
        with stages.stage("probe"):
            planned, budget = plan_bake(inputs, kinds, cage, ray_maps, trees, start)
        result = bake_inputs(kinds, planned, cage, ray_maps, stages, trees)
    finally:
        trees.close()
    budget = replace(budget, actual_seconds=time.perf_counter() - start)
    measured = _measures(inputs.options, cage)
    return replace(result, report=replace(result.report, budget=budget, measured=measured))


def bake_inputs(
    kinds: list[MapKind],
    inputs: BakeInputs,
    cage: Mesh | None,
    ray_maps: RayMaps | None,
    stages: Stages,
    trees: Trees | None = None,
    distances: DistanceSummary | None = None,
) -> BakeResult:
    """Do the same as `bake` with what it has checked, and with what others go on to use."""
    options = inputs.options
    if ray_maps is not None and cage is None:
        ray_maps.check(options.rays)
    secondary = SecondaryRays.for_maps((kind.needs for kind in kinds), inputs)
    trace = Trace(inputs.high, inputs.low, options, cage, stages, secondary, ray_maps, trees)
    sums = TexelSums(kinds, inputs)
    kept: list[Hits] = []
    distances = distances or DistanceSummary()
    if options.is_adaptive:
        from texbake.baking.adaptive_texels.samples import AdaptiveSamples

        sampling = AdaptiveSamples(kinds, trace, inputs, stages, distances).cast(sums)
        return _result(kinds, sums, trace, inputs, stages, None, distances, sampling)
    for hits in trace.hits():
        with stages.part("make maps"):
            sums.add(hits)
            distances.add(hits, threads=options.threads)
        if options.keep_hits:
            kept.append(hits)
    all_hits = Hits.joined(kept) if kept else None
    return _result(kinds, sums, trace, inputs, stages, all_hits, distances)


def remap(result: BakeResult, high: MeshLike, low: MeshLike, options: BakeOptions) -> BakeResult:
    """Make other maps, or the same in another space, from kept hits, without a second trace.

    Parameters
    ----------
    result
        Of a bake with `keep_hits` of the same two meshes.
    options
        `maps`, `space`, `high_shading`, `padding` and `fill` count, and what says how files are
        written; size, samples and all that says how rays go are those of the trace.

    Raises
    ------
    OptionError
        The result kept no hits, or the meshes have other numbers of faces.
    MeshError
        The dense mesh lacks what a map is made from.
    """
    high, low = as_mesh(high), as_mesh(low)
    if (high.n_faces, low.n_faces) != (result.report.n_high_faces, result.report.n_low_faces):
        raise OptionError(
            f"remap: {high.name} and {low.name} are not the meshes that were traced "
            f"({result.report.high} and {result.report.low}); give those"
        )
    materials = None if result.inputs is None else result.inputs.materials
    inputs = BakeInputs(high, low, result.report.options, materials)
    return remap_hits(replace(result, inputs=inputs), options)


def remap_hits(
    result: BakeResult, options: BakeOptions, *, progress: ProgressSink | None = None
) -> BakeResult:
    """Do the same as `remap` with what the result keeps, or what `read_hits` has read, alone."""
    if result.hits is None or result.inputs is None:
        raise OptionError("remap: the bake kept no hits; bake with BakeOptions(keep_hits=True)")
    traced = result.report.options
    of_trace = {name: getattr(traced, name) for name in _OF_TRACE}
    options = replace(options, max_error=None, time_budget=None, **of_trace)
    kinds = map_kinds(options.maps)
    inputs = result.inputs.with_options(options)
    check_maps(kinds, inputs)
    stages = Stages(progress)
    sums = TexelSums(kinds, inputs)
    with stages.stage("make maps"):
        sums.add(result.hits)
    has_data = result.has_data
    charts = _texel_charts(inputs, result.texel_faces)
    maps, meets = finished_maps(kinds, sums.means, charts, has_data, inputs, stages)
    report = replace(
        result.report, options=options, padding_meets=meets, stages=list(stages.records)
    )
    return BakeResult(maps, report, result.hits, result.texel_faces, has_data, inputs)


def _result(
    kinds: list[MapKind],
    sums: TexelSums,
    trace: Trace,
    inputs: BakeInputs,
    stages: Stages,
    hits: Hits | None,
    distances: DistanceSummary,
    sampling: SamplingReport | None = None,
) -> BakeResult:
    options = inputs.options
    has_data = (sums.n_hits > 0).reshape(options.height_px, options.width_px)
    n_covered = int(np.count_nonzero(trace.texel_faces != NO_FACE))
    n_missed = n_covered - int(np.count_nonzero(has_data))
    if n_covered == 0:
        raise UvError(
            f"{inputs.low.name}: its texture coordinates cover no texel of a "
            f"{options.width_px} x {options.height_px} map; use a greater --size or new coordinates"
        )
    _check_misses(n_missed, n_covered, inputs)
    charts = _texel_charts(inputs, trace.texel_faces)
    maps, meets = finished_maps(kinds, sums.means, charts, has_data, inputs, stages)
    report = BakeReport(
        high=inputs.high.name,
        low=inputs.low.name,
        cage=trace.cage.name if trace.cage is not None else None,
        n_high_faces=inputs.high.n_faces,
        n_low_faces=inputs.low.n_faces,
        options=options,
        front=trace.front,
        back=trace.back or 0.0,
        measured=_measures(options, trace.cage),
        caster=trace.caster,
        texels=options.width_px * options.height_px,
        texels_covered=n_covered,
        texels_missed=n_missed,
        texels_overlapping=trace.counts.samples_overlapping / _samples_of_overlaps(options),
        faces_without_texel=_count_unseen(inputs.low.n_faces, trace.texel_faces),
        padding_meets=meets,
        counts=trace.counts,
        distance_percentiles=distances.percentiles(),
        stages=stages.records,
        versions=library_versions(),
        sampling=sampling,
    )
    kept = None if hits is None else inputs
    return BakeResult(maps, report, hits, trace.texel_faces, has_data, kept)


def _measures(options: BakeOptions, cage: Mesh | None) -> bool:
    """Whether a distance of rays is not given and so measured."""
    return options.back is None or (options.front is None and cage is None)


def _samples_of_overlaps(options: BakeOptions) -> int:
    """Samples a texel on which overlaps were counted."""
    return 1 if options.is_adaptive else options.samples_per_side**2


def _count_unseen(n_faces: int, texel_faces: IntArray) -> int:
    """How many faces own no texel."""
    seen = np.zeros(n_faces + 1, dtype=np.bool_)
    seen[texel_faces] = True  # NO_FACE is -1, and so the last entry
    return n_faces - int(np.count_nonzero(seen[:-1]))


def _check_misses(n_missed: int, n_covered: int, inputs: BakeInputs) -> None:
    limit = inputs.options.fail_on_miss
    percent = 100.0 * n_missed / max(n_covered, 1)
    if limit is not None and percent > limit:
        raise MissError(
            f"{inputs.low.name}: {n_missed} texels ({percent:.3f} %) found no surface of "
            f"{inputs.high.name}, more than the {limit:g} % allowed; raise --front and --back, "
            "or see them with --miss-map and without --fail-on-miss"
        )


def _texel_charts(inputs: BakeInputs, texel_faces: IntArray) -> IntArray:
    """(H, W) int32: chart of the light mesh that covers each texel, `NO_FACE` for none."""
    # NO_FACE is -1, and so the last entry: it has no chart.
    return np.append(inputs.low_charts, NO_FACE).astype(np.int32)[texel_faces]


def finished_maps(
    kinds: list[MapKind],
    means: Callable[[MapKind], npt.NDArray[np.float32]],
    texel_charts: IntArray,
    has_data: npt.NDArray[np.bool_],
    inputs: BakeInputs,
    stages: Stages,
) -> tuple[dict[str, BakedMap], int]:
    """Values of texels to padded maps; also the number of texels where two charts' padding meets.

    Parameters
    ----------
    means
        The values (H, W, C) of a map, which are used up.
    texel_charts : (H, W) int32
        Chart that covers each texel, `NO_FACE` for none.
    """
    options = inputs.options
    with stages.stage("pad"):
        surroundings = Surroundings(texel_charts, has_data, options)
        complete = surroundings
        if any(kind.of_misses for kind in kinds) and surroundings.n_missed:
            complete = Surroundings(texel_charts, texel_charts != NO_FACE, options)
    maps = {}
    for kind in kinds:
        with stages.part("make maps"):
            values = means(kind)
        with stages.part("pad"):
            around = complete if kind.of_misses else surroundings
            values = around.filled(values, kind.neutral(options), kind.combine)
        bounds = None if kind.bounds is None else kind.bounds(inputs)
        legend = () if kind.legend is None else kind.legend(inputs)
        maps[kind.name] = BakedMap(kind, values, has_data, options, bounds, legend)
    return maps, surroundings.n_meeting
