"""`bake-normals`: bake the normals of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.verbs.rays import RAYS
from texbake.verbs.verb import PAGE, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.maps import MapFiles
    from texbake.progress import ProgressSink
    from texbake.sampling.rounds import BudgetClock


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
    progress: ProgressSink | None = None,
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
