"""Options of a bake of many parts, without loading what bakes them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.schema import CheckedOptions, option

OCCLUDERS = ("all", "match")
TEXTURE_SETS = ("none", "groups", "materials")


@dataclass(frozen=True, kw_only=True)
class PartsOptions(CheckedOptions):
    """How the parts of an asset are matched and baked together."""

    match_by_name: bool = option(
        False,
        "Bake each part only from the high-poly parts with its name: body_low from body_high, "
        "body_high_01 and so on. A part is a group of a mesh, or a file. Names with _ignore "
        "are left out.",
    )
    join_objects: bool = option(
        False,
        "Bake the objects of a mesh as one. Otherwise objects that touch have normals and ray "
        "distances of their own, and each is baked from its match if all of them have the "
        "same names in both meshes, with or without their suffixes.",
    )
    high_suffix: str = option(
        "_high",
        "Ending of the names of high-poly parts, in upper or lower case; a number may follow.",
        metavar="WORD",
    )
    low_suffix: str = option(
        "_low", "Ending of the names of low-poly parts, in upper or lower case.", metavar="WORD"
    )
    occluders: str = option(
        "all",
        "Parts that occlude a matched part in ao, bent-normal and thickness: all high-poly "
        "parts, or only its match.",
        choices=OCCLUDERS,
    )
    texture_sets: str = option(
        "none",
        "Bake separate maps for each group of the low-poly meshes (with matched names, each "
        "part), or for each of their materials.",
        choices=TEXTURE_SETS,
    )
    udim: bool = option(False, "Bake every UDIM tile that charts lie in, and not only tile 1001.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.match_by_name:
            self.check_matched(("high_suffix", "low_suffix"))
            return
        if self.join_objects:
            raise OptionError("join_objects, match_by_name: give only one of the two")
        if not self.high_suffix or not self.low_suffix:
            raise OptionError("high_suffix, low_suffix: neither may be empty; use such as _high")
        if self.high_suffix.lower() == self.low_suffix.lower():
            raise OptionError("high_suffix, low_suffix: both are the same; they have to differ")

    def check_matched(self, names: Iterable[str] = ("occluders",)) -> None:
        """Raise `OptionError` if options are given that are only for parts matched by name."""
        for name in names:
            if getattr(self, name) != getattr(PartsOptions, name):
                raise OptionError(
                    f"{name}: this is for parts that are matched by name; give "
                    "`match_by_name=True` as well"
                )
