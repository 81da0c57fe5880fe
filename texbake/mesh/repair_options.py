"""Which repairs a mesh gets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class RepairOptions:
    """Which repairs `repair` makes.

    Attributes
    ----------
    merge : bool
        Join vertices at one position.
    degenerate : bool
        Remove faces without area.
    duplicates : bool
        Remove faces that are there twice.
    winding : bool
        Turn faces over so that neighbors agree and closed parts face outwards.
    coordinates : bool
        Keep texture coordinates. If they are made anew later, `simplify` comes closer to the
        surface without their seams.
    """

    merge: bool = True
    degenerate: bool = True
    duplicates: bool = True
    winding: bool = True
    coordinates: bool = True
