"""Every option of `repair`, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option


@dataclass(frozen=True, kw_only=True)
class RepairOptions(CheckedOptions):
    """Which repairs `repair` makes.

    If new texture coordinates are made later, `simplify` mostly comes closer to the surface
    without the seams of the old ones.
    """

    merge: Annotated[bool, Option("Join vertices at one position.", flag="--merge/--no-merge")] = (
        True
    )
    degenerate: Annotated[
        bool, Option("Remove faces without area.", flag="--degenerate/--no-degenerate")
    ] = True
    duplicates: Annotated[
        bool, Option("Remove faces that are there twice.", flag="--duplicates/--no-duplicates")
    ] = True
    winding: Annotated[
        bool,
        Option(
            "Turn faces over so that neighbors agree and closed parts face outwards.",
            flag="--winding/--no-winding",
        ),
    ] = True
    coordinates: Annotated[
        bool, Option("Keep texture coordinates.", flag="--coordinates/--no-coordinates")
    ] = True
