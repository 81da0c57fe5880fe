"""Other maps from the hits that a bake kept, without casting rays again."""

from __future__ import annotations

from dataclasses import replace

from texbake.baking.bake import check_maps
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import map_kinds
from texbake.baking.options import BakeOptions
from texbake.baking.padding import finished_maps
from texbake.baking.result import BakeResult
from texbake.baking.sums import TexelSums
from texbake.errors import OptionError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.progress import ProgressSink, Stages

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
    result: BakeResult, options: BakeOptions, *, progress: ProgressSink | None = None
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
