"""`bake`: bake maps of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import bake_memory
from texbake.baking.options import BakeOptions
from texbake.baking.parts.matching import PartsOptions
from texbake.errors import FileError, OptionError, quoted
from texbake.files import PathLike, is_folder
from texbake.jobs.outputs import JobResult, write_report
from texbake.records import dataclass
from texbake.verbs.map_bakes import FORMAT, HEIGHTS, RAYS, SOURCES
from texbake.verbs.step import (
    IMAGE_FORMATS,
    Job,
    Settings,
    Sizes,
    n_faces,
    n_texels,
    stage_seconds,
    step_of,
    without_timings,
)
from texbake.verbs.verb import PAGE, Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.progress import Progress

_SECONDARY = ("secondary_rays", "denoise", "occluder_distance", "thickness_distance")
_PARTS = (
    *("match_by_name", "join_objects", "high_suffix", "low_suffix", "occluders"),
    "texture_sets",
)
# Headings of the help of `texbake bake`, with the options below them.
SECTIONS = {
    "Rays": (
        *("front", "back", "max_reach", "cage", "rays", "skew_mask", "offset_map", "orientation"),
        *("high_shading", "high_normal_maps", "cull_back_faces", "on_miss", "fail_on_miss"),
        *("miss_map", "samples", "max_error", "time_budget"),
    ),
    "Values of the maps": (
        *("space", "convention", "bits", "mid", "scale", "vertex_colors", "high_texture"),
        *("curvature_scale", *_SECONDARY),
    ),
    "Assets of many parts": ("more_high", "more_low", *_PARTS, "dry_run"),
    "Files and resources": (
        *("fill", "bake_island", "name_pattern", "hits", "html", "report"),
        *("max_memory", "threads", "quiet", "verbose", "progress"),
    ),
}


def _more(side: str, kind: str) -> Reads:
    return Reads(
        f"more_{side}",
        "mesh",
        f"Another {kind} mesh, or a folder of them; repeatable.",
        flags=(f"--{side}",),
        required=False,
        many=True,
        metavar="MESH|DIR",
    )


def _with_parts(values: dict[str, Any]) -> dict[str, Any]:
    rest = dict(values)
    chosen = {name: rest.pop(name) for name in _PARTS}
    return {**rest, "parts": PartsOptions(udim="{udim}" in rest["name_pattern"], **chosen)}


@verb(
    Reads("high", argument=True, required=False),
    Reads("low", argument=True, required=False),
    Writes("output", "folder", "Folder of the maps, which is made if it is missing."),
    Options(BakeOptions, "maps"),
    FORMAT,
    *RAYS,
    HEIGHTS,
    *SOURCES,
    Options(BakeOptions, *_SECONDARY),
    _more("high", "high-poly"),
    _more("low", "low-poly"),
    Options(PartsOptions, *_PARTS, apart=True),
    Extra(
        "--dry-run",
        "Only print which parts would be baked from which, and what is left over.",
        is_flag=True,
    ),
    PAGE,
    sections=SECTIONS,
    common=("front", "back", "cage", "samples", "space", "convention", "match_by_name"),
    examples="""
      texbake bake scan.ply low.obj -o maps --maps normal,displacement --size 2048
      texbake bake scan.ply low.obj -o maps --maps normal --cage cage.obj --fail-on-miss 0.5
      texbake bake high.glb low.glb -o maps --match-by-name --dry-run
    """,
    prepare=_with_parts,
)
def bake(
    high: PathLike | None,
    low: PathLike | None,
    output: PathLike,
    options: BakeOptions,
    *,
    parts: PartsOptions,
    more_high: Sequence[PathLike],
    more_low: Sequence[PathLike],
    dry_run: bool,
    report: PathLike | None,
    progress: Progress,
    clock: Any,
    format: str | None,  # noqa: A002
    name_pattern: str,
    **others: Any,
) -> JobResult[Any]:
    """Bake one or several maps of HIGH for LOW.

    HIGH is the high-poly mesh, LOW the low-poly mesh that the maps are for. All maps are made
    with the same rays. LOW needs texture coordinates (texbake unwrap). Without --front, --back
    and --cage, ray distances are fitted at each vertex.
    """
    from texbake.jobs.maps import BakeFiles, bake_files
    from texbake.jobs.parts import bake_parts_files, match_parts_files, needs_parts

    files = BakeFiles(**others)
    if more_high and low is None:  # a single argument is the low-poly mesh
        high, low = None, high
    highs, lows = _meshes("high", high, more_high), _meshes("low", low, more_low)
    # What only the bake of one mesh onto one set of maps can do.
    of_one_mesh = (files.html, files.hits, options.time_budget, options.max_memory)
    pair = all(value is None for value in of_one_mesh)
    if not (dry_run or needs_parts(highs, lows, parts, pair=pair)):
        return bake_files(
            highs[0], lows[0], output, options, files, format=format, name_pattern=name_pattern,
            join_objects=parts.join_objects, progress=progress, clock=clock,
        )  # fmt: skip
    for name in ("html", "hits"):
        if getattr(files, name) is not None:
            raise OptionError(f"{name}: is for the bake of one mesh onto one set of maps")
    if dry_run:
        return match_parts_files(highs, lows, parts, progress=progress)
    return bake_parts_files(
        highs, lows, output, options, parts, files, name=Path(low or more_low[0]).stem,
        format=format, name_pattern=name_pattern, progress=progress,
    )  # fmt: skip


def _meshes(side: str, first: PathLike | None, more: Sequence[PathLike]) -> list[Path]:
    """Return the files, and the meshes in folders sorted by name, without duplicates."""
    from texbake.mesh.files import MESH_SUFFIXES

    files: dict[Path, None] = {}
    for path in (Path(path) for path in (first, *more) if path is not None):
        if not is_folder(path):
            files[path] = None
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in MESH_SUFFIXES)
        if not inside:
            raise FileError(f"{path}: there is no mesh in it; give a folder of mesh files")
        files.update(dict.fromkeys(inside))
    if not files:
        raise OptionError(f"{side}: it is missing; name a mesh or a folder of meshes")
    return list(files)


@dataclass(frozen=True, kw_only=True)
class BakeStep(BakeOptions):
    """How maps are baked; further attributes are those of `BakeOptions`.

    Attributes
    ----------
    format : str or dict of str to str
        Image format of all maps, or of each by its name; png for a map without one.
    """

    format: Any = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        formats = self.format if isinstance(self.format, dict) else {"": self.format}
        for name, value in formats.items():
            if name and name not in self.maps:
                raise OptionError(
                    f"format: {quoted(name)} is not one of the maps, {', '.join(self.maps)}"
                )
            if value not in IMAGE_FORMATS:
                known = ", ".join(IMAGE_FORMATS)
                raise OptionError(f"format: {quoted(value)} is not one of {known}")


def _step(job: Job) -> dict[str, Any]:
    from texbake.baking.bake import streaming_obstacle
    from texbake.baking.maps import map_kinds
    from texbake.jobs.maps import BakeFiles, bake_files

    options = STEP.made(job.settings, threads=job.threads)
    # A limit changes no byte; some maps need the high-poly mesh as a whole.
    whole = streaming_obstacle(map_kinds(options.maps), options) or job.input("high_texture")
    options = replace(options, max_memory=None if whole else job.most_memory)
    result = bake_files(
        job.file("high"),
        job.file("low"),
        {name: job.outputs[name] for name in job.settings["maps"]},
        options,
        BakeFiles(
            cage=job.input("cage"),
            high_texture=job.input("high_texture"),
            miss_map=job.outputs["misses"],
        ),
    )
    report = result.to_json()
    for file in report["files"].values():
        file["path"] = file["path"].name  # the folder is a temporary one
    write_report(job.outputs["report"], without_timings(report))
    return {
        "faces": result.report.n_low_faces,
        "miss_percent": result.report.miss_percent,
        "texels_covered": result.report.texels_covered,
        "distance_percentiles": {str(k): v for k, v in result.report.distance_percentiles.items()},
        "notes": list(result.report.warnings),
        "stages": stage_seconds(result.report.stages),
    }


def _map_files(settings: Settings) -> dict[str, str]:
    formats = settings["format"]
    suffixes = {
        name: formats.get(name, "png") if isinstance(formats, dict) else formats
        for name in settings["maps"]
    }
    maps = {name: f"{name}.{suffix}" for name, suffix in suffixes.items()}
    return {**maps, "misses": "misses.png", "report": "report.json"}


def _memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate without a memory limit."""
    n_low = n_faces(sizes, "low", "cage")
    return bake_memory(n_faces(sizes, "high"), n_low, n_texels(settings), settings["maps"])


STEP = step_of(
    bake,
    does="bakes maps of a high-poly mesh for a low-poly mesh",
    options=BakeStep,
    # What a time budget allows depends on the machine; the same inputs must give the same bytes.
    without=("threads", "max_memory", "keep_hits", "time_budget"),
    inputs=(
        Reads("high"),
        Reads("low"),
        Reads("cage", required=False),
        Reads("high_texture", required=False),
    ),
    outputs=_map_files,
    run=_step,
    memory=_memory,
    revision=4,
)
