"""`bake-normals` and `bake-displacement`, of one map each, `remap`, and parts that bakes share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.maps import DEFAULT_PATTERN
from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.verbs.step import IMAGE_FORMATS
from texbake.verbs.verb import PAGE, REPORT, THREADS, Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.maps import MapFiles
    from texbake.progress import Progress
    from texbake.sampling.rounds import BudgetClock

FORMAT = Extra(
    "--format",
    "File format of the maps; exr and tif store heights as floats.  [default: png]",
    choices=IMAGE_FORMATS,
)
NAME_PATTERN = Extra(
    "--name-pattern",
    "Names of the files: {asset} is the low-poly mesh's file without suffix, {map} the map, "
    "{set} the texture set, {udim} the tile (with it all tiles are baked), {ext} the format.",
    default=DEFAULT_PATTERN,
    show_default=True,
    metavar="PATTERN",
)
HEIGHTS = Options(BakeOptions, "mid", "scale")
RAYS = (
    Options(BakeOptions, "size", "samples", "max_error", "time_budget"),
    Options(BakeOptions, "space", "convention", "bits", "front", "back", "max_reach"),
    Reads(
        "cage",
        "mesh",
        "Start the rays on this mesh, which is the low-poly mesh with its vertices moved outwards.",
        required=False,
    ),
    Options(BakeOptions, "rays"),
    Reads(
        "skew_mask",
        "image",
        "Blend the direction of the rays by this image on the low-poly mesh's coordinates, "
        "from --rays (0) to the face's normal (1).",
        required=False,
    ),
    Reads(
        "offset_map",
        "image",
        "Multiply the front distance, or the cage's offset, by this image. Values are 0 to 1; "
        "float files may hold greater ones.",
        required=False,
    ),
    Options(BakeOptions, "orientation", "high_shading", "high_normal_maps"),
    Options(BakeOptions, "cull_back_faces", "padding", "fill"),
    Options(BakeOptions, "on_miss", "fail_on_miss", "bake_island"),
    Writes("miss_map", "picture", "Also draw where rays missed."),
    REPORT,
    Options(BakeOptions, "max_memory", "threads"),
)
SOURCES = (
    Reads(
        "high_texture",
        "image",
        "Image on the high-poly mesh's texture coordinates, for one map of its materials, such "
        "as base-color, or roughness, which is data.  [default: those that its file names]",
        required=False,
    ),
    Options(BakeOptions, "vertex_colors", "curvature_scale"),
    NAME_PATTERN,
    Writes("hits", "hits", "Also keep the hits, from which texbake remap makes other maps."),
)


@verb(
    Reads("high"),
    Reads("low"),
    Writes(
        "output",
        "image",
        "The normal map: png, exr, tif or tga.",
        suffixes=(".png", ".exr", ".tif", ".tga"),
    ),
    *RAYS,
    PAGE,
    examples="""
      texbake bake-normals scan.ply low.obj -o normal.png --size 2048
      texbake bake-normals scan.ply low.obj -o normal.tga --convention directx --samples 4
    """,
)
def bake_normals(
    high: PathLike,
    low: PathLike,
    output: PathLike,
    options: BakeOptions,
    *,
    report: PathLike | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
    **files: Any,
) -> MapFiles:
    """Bake a normal map of HIGH for LOW.

    LOW needs texture coordinates (texbake unwrap). Without --front, --back and --cage, ray
    distances are fitted at each vertex; the summary and the report contain them.
    """
    from texbake.jobs.maps import BakeFiles, bake_files

    maps, others = {"normal": output}, BakeFiles(**files)
    return bake_files(high, low, maps, options, others, progress=progress, clock=clock)


@verb(
    Reads("high"),
    Reads("low"),
    Writes(
        "output",
        "image",
        "The displacement map: exr, tif or png.",
        suffixes=(".exr", ".tif", ".png"),
    ),
    *RAYS,
    HEIGHTS,
    PAGE,
    examples="""
      texbake bake-displacement scan.ply low.obj -o height.exr --size 2048
      texbake bake-displacement scan.ply low.obj -o height.png --mid 0.5 --scale 0.2
    """,
)
def bake_displacement(
    high: PathLike,
    low: PathLike,
    output: PathLike,
    options: BakeOptions,
    *,
    report: PathLike | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
    **files: Any,
) -> MapFiles:
    """Bake a displacement map of HIGH for LOW.

    The map contains the signed distances from LOW to HIGH along the smooth normals of LOW, in
    model units, positive outwards. Moving a finely subdivided LOW by them gives HIGH. Float files
    contain the distances d themselves. Integer files contain h with d = (h - mid) * scale, and
    mid and scale are in their metadata.
    """
    from texbake.jobs.maps import BakeFiles, bake_files

    maps, others = {"displacement": output}, BakeFiles(**files)
    return bake_files(high, low, maps, options, others, progress=progress, clock=clock)


# Options of the bake that other maps of its hits can change.
_CHANGES = (
    *("maps", "space", "convention", "bits", "mid", "scale", "curvature_scale"),
    *("thickness_distance", "vertex_colors", "high_shading", "padding", "fill"),
)


def _with_changes(values: dict[str, Any]) -> dict[str, Any]:
    names = (*_CHANGES, "threads")
    changes = {name: values[name] for name in names if values[name] is not None}
    return {**{name: values[name] for name in values if name not in names}, "changes": changes}


@verb(
    Reads("hits", "hits", suffixes=(".npz",)),
    Writes("output", "folder", "Folder of the maps, which is made if it is missing."),
    FORMAT,
    Options(BakeOptions, *_CHANGES, apart=True, unset=True),
    NAME_PATTERN,
    REPORT,
    THREADS,
    examples="""
      texbake remap scan.npz -o maps --maps curvature,position --format exr
      texbake remap scan.npz -o directx --maps normal --convention directx --bits 8
    """,
    prepare=_with_changes,
)
def remap_files(
    hits: PathLike,
    output: PathLike,
    changes: Mapping[str, Any] | None = None,
    *,
    format: str | None = None,  # noqa: A002
    name_pattern: str = DEFAULT_PATTERN,
    report: PathLike | None = None,
    progress: Progress = None,
) -> MapFiles:
    """Make other maps from the hits of an earlier bake.

    HITS is a file written by texbake bake --hits. No meshes are needed and no rays are cast.
    Options that are not given keep their values from that bake. The maps are byte for byte those
    that a bake would write.
    """
    from texbake.baking.bake import remap_hits
    from texbake.baking.hits_file import read_hits
    from texbake.jobs.maps import (
        check_map_files,
        clipping_warnings,
        map_files,
        named_maps,
        written_maps,
    )
    from texbake.jobs.outputs import check_distinct
    from texbake.progress import Stages

    stages = Stages(progress)
    with stages.stage("read hits"):
        kept = read_hits(hits)
    options = replace(kept.report.options, **(changes or {}))
    files = named_maps(Path(output), name_pattern, Path(kept.report.low).stem, options.maps, format)
    check_distinct([*files.values(), report], [hits])
    check_map_files(files, options)
    result = remap_hits(kept, options, progress=progress)
    with stages.stage("write maps"):
        written = written_maps(result, files, Path(output))
    map_result = map_files(result.report, stages.records, written)
    # Warnings about the rays were given when they were cast.
    return replace(map_result, warnings=clipping_warnings(written.values()))
