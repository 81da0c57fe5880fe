"""`remap`: make other maps from the hits of an earlier bake."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.maps import DEFAULT_PATTERN
from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.verbs.map_bakes import FORMAT, NAME_PATTERN
from texbake.verbs.verb import REPORT, THREADS, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.maps import MapFiles
    from texbake.progress import ProgressSink

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
    progress: ProgressSink | None = None,
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
    asset = Path(kept.report.low).stem
    files = named_maps(Path(output), name_pattern, asset, options.maps, format)
    check_distinct([*files.values(), report], [hits])
    check_map_files(files, options)
    result = remap_hits(kept, options, progress=progress)
    with stages.stage("write maps"):
        written = written_maps(result, files, Path(output))
    done = map_files(result.report, stages.records, written)
    # Warnings about the rays were given when they were cast.
    return replace(done, warnings=clipping_warnings(written.values()))
