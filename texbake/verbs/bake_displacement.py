"""`bake-displacement`: bake the displacement of a high-poly mesh for a low-poly mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.verbs.rays import HEIGHTS, RAYS
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
    progress: ProgressSink | None = None,
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
