"""Every option of `repair`, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option


@dataclass(frozen=True, kw_only=True)
class RepairOptions(CheckedOptions):
    """Which repairs `repair` makes.

    If texture coordinates are made anew later, `simplify` comes closer to the surface without the
    seams of the old ones.
    """

    merge: Annotated[bool, Option("Join vertices at one position.")] = True
    degenerate: Annotated[bool, Option("Remove faces without area.")] = True
    duplicates: Annotated[bool, Option("Remove faces that are there twice.")] = True
    winding: Annotated[
        bool,
        Option("Turn faces over so that neighbors agree and closed parts face outwards."),
    ] = True
    coordinates: Annotated[bool, Option("Keep texture coordinates.")] = True
