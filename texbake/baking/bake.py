"""From a high-poly and a low-poly mesh to maps: the stages of a bake in their order."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind, map_kinds
from texbake.baking.options import ADAPTIVE, BakeOptions
from texbake.baking.rays import RayMaps, checked_cage
from texbake.baking.report import BakeReport, DistanceSummary, library_versions
from texbake.baking.result import BakeResult, unseen_faces
from texbake.baking.scenes import face_outwards
from texbake.baking.texel_values import TexelSums, finished_maps
from texbake.baking.texels import NO_FACE
from texbake.baking.trace import BakeSetup, Trace
from texbake.errors import MissError, OptionError, UvError, counted
from texbake.mapping.overlap import StackedIslands
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.progress import Progress, Stages
from texbake.raycast.orientation import OrientationReport
from texbake.records import dataclass
from texbake.sampling.report import SamplingReport
from texbake.sampling.rounds import BudgetClock, TimeBudget, with_actual_time


def bake(
    high: MeshLike | StreamedMesh,
    low: MeshLike,
    options: BakeOptions | None = None,
    *,
    cage: MeshLike | None = None,
    materials: Materials | None = None,
    skew_mask: npt.ArrayLike | None = None,
    offset_map: npt.ArrayLike | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> BakeResult:
    """Bake the detail of a high-poly mesh into maps of a low-poly mesh.

    Parameters
    ----------
    high
        The high-poly mesh; one from `texbake.mesh.streamed.mesh.open_streamed` stays in its file.
    low
        The low-poly mesh, with texture coordinates.
    options
        None for `BakeOptions()`.
    cage
        The faces of the low-poly mesh with other positions; rays start on it.
    materials
        Of the high-poly mesh, for the maps `texture` and `material-id`; see `read_materials`.
    skew_mask : (H, W) floats, optional
        Over the texture coordinates of the low-poly mesh: 0 where rays have the direction that
        `BakeOptions.rays` specifies, 1 where they follow the face normal, between them a blend.
    offset_map : (H, W) floats, optional
        Over the same coordinates: a factor for the front distance, or that of the cage, 0 or more.
    progress
        True shows a bar for the running stage; a listener is called with each stage.
    clock
        When the time of `BakeOptions.time_budget` began, and what follows the bake; None: it begins
        now, and nothing follows.

    Returns
    -------
    BakeResult
        The same, byte for byte, for any number of threads. With a time budget, the same as with the
        bound that the report names.

    Raises
    ------
    UvError
        The low-poly mesh has no texture coordinates, or they cover nothing.
    CageError
        The cage has other faces than the low-poly mesh.
    MeshError
        The meshes are below 1e-30 or above 1e37 model units across, beyond the float32 of maps; or
        the high-poly mesh lacks what a map is made from.
    MissError
        More texels missed than `options.fail_on_miss` allows.
    OptionError
        A map is unknown, or an image has values out of range.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> result = bake(plane(), plane(), BakeOptions(size=16))
    >>> result.maps["normal"].values[8, 8].tolist()
    [0.0, 0.0, 1.0]
    """
    clock = clock or BudgetClock()
    high = high if isinstance(high, StreamedMesh) else as_mesh(high)
    low = as_mesh(low)
    cage = None if cage is None else as_mesh(cage)
    options = options or BakeOptions()
    kinds = map_kinds(options.maps)
    inputs = BakeInputs.of(high, low, options, materials)
    check_maps(kinds, inputs)
    if cage is not None:
        cage = checked_cage(cage, low)
        if options.front is not None:
            raise OptionError("front, cage: rays start on the cage; give only one of the two")
    ray_maps = RayMaps.of(skew_mask, offset_map)
    return BakeRun(kinds, inputs, Stages(progress), cage, ray_maps, clock=clock).run()


def check_maps(kinds: list[MapKind], inputs: BakeInputs) -> None:
    """Raise if a map cannot be made from the inputs."""
    if inputs.stream is not None and (reason := streaming_obstacle(kinds, inputs.options)):
        raise OptionError(f"max_memory: {inputs.stream.name} would be read in chunks, {reason}")
    for kind in kinds:
        kind.require(inputs)
        if kind.of_misses and (inputs.options.is_adaptive or inputs.options.time_budget):
            raise OptionError(
                f"maps, samples: {kind.name} counts misses among a fixed number of samples; use "
                "1, 4, 16 or 64 `samples`, or bake it separately"
            )
        if kind.of_misses and inputs.options.on_miss == "closest":
            raise OptionError(
                f"maps, on_miss: {kind.name} counts misses, and none are left; bake it separately"
            )


def streaming_obstacle(kinds: list[MapKind], options: BakeOptions) -> str | None:
    """Return why maps cannot be baked of a mesh that is read in chunks; None if they can."""
    whole = [kind.name for kind in kinds if kind.of_neighbors or kind.needs != "hits"]
    if whole:
        return f"and {', '.join(whole)} need all of it at once; bake them without `max_memory`"
    if options.is_adaptive or options.time_budget is not None:
        return "once for each round of samples; use 1, 4, 16 or 64 `samples`"
    if options.on_miss == "closest":
        return "and the closest point needs all of it at once; use on_miss neutral"
    if options.keep_hits:
        return "and its hits cannot be kept; bake all maps at once"
    return None


@dataclass(frozen=True, eq=False)
class BakeRun(BakeSetup):
    """A bake whose inputs have been checked."""

    # Collects the distances between the surfaces.
    distances: DistanceSummary = field(default_factory=DistanceSummary)
    clock: BudgetClock = field(default_factory=BudgetClock)
    orientation: OrientationReport | None = None  # what was flipped of the high-poly mesh

    def run(self) -> BakeResult:
        """Return the maps and the report, with the high-poly mesh facing outwards."""
        inputs = self.inputs
        if self.ray_maps is not None and self.cage is None:
            self.ray_maps.check(inputs.options.rays)
        stacked = StackedIslands.of(inputs.low, inputs.options.bake_island)
        if stacked.n_sharing:
            inputs = inputs.with_low(stacked.baked(inputs.low))
        run = replace(self, inputs=inputs)
        if self.scenes is None:
            inputs, scenes, orientation = face_outwards(inputs, run.build_scenes(), self.stages)
            run = replace(run, inputs=inputs, scenes=scenes, orientation=orientation)
        return run._cast(stacked)

    def _cast(self, stacked: StackedIslands) -> BakeResult:
        """Cast all rays, and make maps of the hits."""
        options, trace = self.inputs.options, Trace(self)
        sums = TexelSums(self.kinds, self.inputs)
        if options.is_adaptive or options.time_budget is not None:
            from texbake.baking.adaptive_texels.samples import cast_adaptively

            sampling, budget = cast_adaptively(sums, trace, self.distances, self.clock)
            if budget is None:
                return self._result(sums, trace, stacked, sampling=sampling)
            # The options without a time budget that give the same maps.
            options = replace(
                options, time_budget=None, samples=ADAPTIVE, max_error=budget.max_error
            )
            reached = replace(self, inputs=self.inputs.with_options(options))
            return reached._result(sums, trace, stacked, sampling=sampling, budget=budget)
        kept: list[Hits] = []
        for hits in trace.hits():
            with self.stages.part("make maps"):
                sums.add(hits)
                self.distances.add(hits, threads=options.threads)
            if options.keep_hits:
                kept.append(hits)
        return self._result(sums, trace, stacked, hits=Hits.joined(kept) if kept else None)

    def _result(
        self,
        sums: TexelSums,
        trace: Trace,
        stacked: StackedIslands,
        *,
        hits: Hits | None = None,
        sampling: SamplingReport | None = None,
        budget: TimeBudget | None = None,
    ) -> BakeResult:
        """Pad the maps, and report on them and on the trace."""
        inputs, options, counts = self.inputs, self.inputs.options, trace.counts
        has_data = (sums.n_hits > 0).reshape(options.height_px, options.width_px)
        n_covered = int(np.count_nonzero(trace.texel_faces != NO_FACE))
        n_missed = n_covered - int(np.count_nonzero(has_data))
        _check_misses(n_missed, n_covered, inputs)
        # Overlaps are counted among the first samples alone.
        samples_per_texel = 1 if options.is_adaptive else options.samples_per_side**2
        charts = inputs.texel_charts(trace.texel_faces)
        maps, meets = finished_maps(self.kinds, sums.means, charts, has_data, inputs, self.stages)
        # Faces that share the texels of others have no area in the texture on purpose.
        n_sharing = int(stacked.shares.sum())
        counts.faces_without_uv_area -= n_sharing
        counts.islands_sharing = stacked.n_sharing
        n_unseen = int(unseen_faces(inputs.low.n_faces, trace.texel_faces).sum())
        report = BakeReport(
            high=inputs.source.name,
            low=inputs.low.name,
            cage=trace.cage.name if trace.cage is not None else None,
            n_high_faces=inputs.source.n_faces,
            n_low_faces=inputs.low.n_faces,
            options=options,
            front=trace.front,
            back=trace.back or 0.0,
            measured=options.back is None or (options.front is None and trace.cage is None),
            caster=trace.scenes.high.caster,
            texels=options.width_px * options.height_px,
            texels_covered=n_covered,
            texels_missed=n_missed,
            texels_overlapping=counts.samples_overlapping / samples_per_texel,
            faces_without_texel=n_unseen - n_sharing,
            padding_meets=meets,
            counts=counts,
            distance_percentiles=self.distances.percentiles(),
            stages=self.stages.records,
            versions=library_versions(),
            orientation=self.orientation,
            sampling=sampling,
            budget=None if budget is None else with_actual_time(budget, self.clock),
            median_reach=trace.median_reach,
        )
        kept = None if hits is None else inputs
        return BakeResult(maps, report, hits, trace.texel_faces, has_data, kept)


def _check_misses(n_missed: int, n_covered: int, inputs: BakeInputs) -> None:
    options = inputs.options
    if n_covered == 0:
        raise UvError(
            f"{inputs.low.name}: its texture coordinates cover no texel of a {options.width_px} x "
            f"{options.height_px} map; use a larger `size` or new coordinates"
        )
    limit, percent = options.fail_on_miss, 100.0 * n_missed / n_covered
    if limit is not None and percent > limit:
        raise MissError(
            f"{inputs.low.name}: the rays of {counted(n_missed, 'texel')} ({percent:.3f} %) missed "
            f"{inputs.source.name}, more than the {limit:g} % allowed; raise `front` and "
            "`back`, or bake without `fail_on_miss` and see the misses with `miss_map`"
        )


# Options of the rays; other maps from the same hits keep those of the bake.
_OF_TRACE = (
    "size",
    "samples",
    "rays",
    "front",
    "back",
    "cull_back_faces",
    "secondary_rays",
    "occluder_distance",
    "on_miss",
    "fail_on_miss",
    "keep_hits",
)


def remap(result: BakeResult, high: MeshLike, low: MeshLike, options: BakeOptions) -> BakeResult:
    """Make other maps, or the same ones in another space, from kept hits, without casting rays.

    Parameters
    ----------
    result
        Of a bake of the same two meshes with `keep_hits`.
    options
        `maps`, `space`, `high_shading`, `padding`, `fill` and the options of files are used; size,
        samples and all options of rays are those of the bake that kept the hits.

    Raises
    ------
    OptionError
        The result has no hits, or the meshes have other numbers of faces.
    MeshError
        The high-poly mesh lacks what a map is made from.
    """
    high, low = as_mesh(high), as_mesh(low)
    if (high.n_faces, low.n_faces) != (result.report.n_high_faces, result.report.n_low_faces):
        raise OptionError(
            f"high, low: {high.name} and {low.name} are not the meshes that were baked; give "
            f"{result.report.high} and {result.report.low}"
        )
    materials = None if result.inputs is None else result.inputs.materials
    inputs = BakeInputs.of(high, low, result.report.options, materials)
    return remap_hits(replace(result, inputs=inputs), options)


def remap_hits(
    result: BakeResult, options: BakeOptions, *, progress: Progress = None
) -> BakeResult:
    """Do as `remap`, from the result of a bake or of `read_hits` alone, without the meshes."""
    if result.hits is None or result.inputs is None:
        raise OptionError("hits: the bake kept none; bake with `keep_hits=True`")
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
    charts = inputs.texel_charts(result.texel_faces)
    maps, meets = finished_maps(kinds, sums.means, charts, has_data, inputs, stages)
    report = replace(
        result.report, options=options, padding_meets=meets, stages=list(stages.records)
    )
    return BakeResult(maps, report, result.hits, result.texel_faces, has_data, inputs)
