"""A dense and a light mesh to maps: the stages of a bake in their order."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.bake.baked_map import BakedMap
from texbake.bake.hits import Hits
from texbake.bake.inputs import BakeInputs
from texbake.bake.maps import map_kinds
from texbake.bake.maps.kind import MapKind
from texbake.bake.options import BakeOptions
from texbake.bake.rays import check_cage
from texbake.bake.report import BakeReport, DistanceSummary, library_versions
from texbake.bake.result import BakeResult
from texbake.bake.sampling import SamplingReport
from texbake.bake.sums import TexelSums
from texbake.bake.surround import Surroundings
from texbake.bake.texels import NO_FACE
from texbake.bake.trace import Trace
from texbake.errors import MissError, OptionError, UvError
from texbake.mesh.mesh import IntArray, Mesh
from texbake.progress import ProgressSink, Stages


def bake(
    high: Mesh,
    low: Mesh,
    options: BakeOptions | None = None,
    *,
    cage: Mesh | None = None,
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
        The meshes are below 1e-30 or above 1e37 model units across, beyond the float32 of maps.
    MissError
        More texels missed than `options.fail_on_miss` allows.
    OptionError
        A map that is not known.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> result = bake(plane(), plane(), BakeOptions(size=16))
    >>> result.maps["normal"].values[8, 8].tolist()
    [0.0, 0.0, 1.0]
    """
    options = options or BakeOptions()
    kinds = map_kinds(options.maps)
    if cage is not None:
        check_cage(cage, low)
        if options.front is not None:
            raise OptionError("front, cage: rays start on the cage; give one of the two")
    if options.time_budget is not None:
        return _bake_in_time(kinds, BakeInputs(high, low, options), cage, progress)
    return _bake(kinds, BakeInputs(high, low, options), cage, Stages(progress))


def _bake_in_time(
    kinds: list[MapKind], inputs: BakeInputs, cage: Mesh | None, progress: ProgressSink | None
) -> BakeResult:
    from texbake.bake.budget import plan_bake

    start = time.perf_counter()
    stages = Stages(progress)
    with stages.stage("probe"):
        planned, budget = plan_bake(inputs.high, inputs.low, kinds, inputs.options, cage)
    result = _bake(kinds, planned, cage, stages)
    budget = replace(budget, actual_seconds=time.perf_counter() - start)
    measured = _measures(inputs.options, cage)
    return replace(result, report=replace(result.report, budget=budget, measured=measured))


def _bake(
    kinds: list[MapKind], inputs: BakeInputs, cage: Mesh | None, stages: Stages
) -> BakeResult:
    options = inputs.options
    trace = Trace(inputs.high, inputs.low, options, cage, stages)
    sums = TexelSums(kinds, inputs)
    kept: list[Hits] = []
    distances = DistanceSummary()
    if options.is_adaptive:
        from texbake.bake.adaptive import AdaptiveSamples

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


def remap(result: BakeResult, high: Mesh, low: Mesh, options: BakeOptions) -> BakeResult:
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
    """
    if result.hits is None:
        raise OptionError("remap: the bake kept no hits; bake with BakeOptions(keep_hits=True)")
    if (high.n_faces, low.n_faces) != (result.report.n_high_faces, result.report.n_low_faces):
        raise OptionError(
            f"remap: {high.name} and {low.name} are not the meshes that were traced "
            f"({result.report.high} and {result.report.low}); give those"
        )
    traced = result.report.options
    options = replace(
        options,
        size=traced.size,
        samples=traced.samples,
        rays=traced.rays,
        front=traced.front,
        back=traced.back,
        cull_back_faces=traced.cull_back_faces,
    )
    kinds = map_kinds(options.maps)
    stages = Stages()
    inputs = BakeInputs(high, low, options)
    sums = TexelSums(kinds, inputs)
    with stages.part("make maps"):
        sums.add(result.hits)
    has_data = result.has_data
    maps, meets = _finished(kinds, sums, inputs, has_data, result.texel_faces, stages)
    report = replace(
        result.report, options=options, padding_meets=meets, stages=list(stages.records)
    )
    return BakeResult(maps, report, result.hits, result.texel_faces, has_data)


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
    maps, meets = _finished(kinds, sums, inputs, has_data, trace.texel_faces, stages)
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
    return BakeResult(maps, report, hits, trace.texel_faces, has_data)


def _measures(options: BakeOptions, cage: Mesh | None) -> bool:
    """Whether a distance of rays is not given and so measured."""
    return options.back is None or (options.front is None and cage is None)


def _samples_of_overlaps(options: BakeOptions) -> int:
    """Samples a texel on which overlaps were counted."""
    if not options.is_adaptive:
        return options.samples_per_side**2
    from texbake.bake.cells import COVERAGE_SIDE

    return COVERAGE_SIDE**2


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


def _finished(
    kinds: list[MapKind],
    sums: TexelSums,
    inputs: BakeInputs,
    has_data: npt.NDArray[np.bool_],
    texel_faces: IntArray,
    stages: Stages,
) -> tuple[dict[str, BakedMap], int]:
    """Turn sums into padded maps; also the number of texels where two charts' padding meets."""
    options = inputs.options
    with stages.stage("pad"):
        # NO_FACE is -1, and so the last entry: it has no chart.
        texel_charts = np.append(inputs.low_charts, NO_FACE).astype(np.int32)[texel_faces]
        surroundings = Surroundings(texel_charts, has_data, options)
    maps = {}
    for kind in kinds:
        with stages.part("make maps"):
            values = sums.means(kind)
        with stages.part("pad"):
            values = surroundings.filled(
                values, kind.neutral(options), unit_vectors=kind.coding == "normal"
            )
        maps[kind.name] = BakedMap(kind, values, has_data, options)
    return maps, surroundings.n_meeting
