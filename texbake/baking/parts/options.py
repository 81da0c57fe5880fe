"""Choices of a bake of many parts, without loading what bakes them."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import OptionError

OCCLUDERS = ("all", "match")
TEXTURE_SETS = ("none", "groups", "materials")


@dataclass(frozen=True, kw_only=True)
class PartsOptions:
    """How the parts of an asset are told apart and put together.

    Attributes
    ----------
    match_by_name : bool
        Parts of the light meshes see only the dense parts of their name.
    high_suffix, low_suffix : str
        What the names of dense and of light parts end with; case is ignored.
    occluders : str
        What rays of `ao`, `bent-normal` and `thickness` meet: `all` parts, or the `match` alone.
    texture_sets : str
        Which faces of the light meshes get maps of their own: `none`, each of their `groups` (where
        names are matched, each part), or each of their `materials`.
    udim : bool
        Bake every tile that charts lie in, 1001 and on, and not the first alone.
    """

    match_by_name: bool = False
    high_suffix: str = "_high"
    low_suffix: str = "_low"
    occluders: str = "all"
    texture_sets: str = "none"
    udim: bool = False

    def __post_init__(self) -> None:
        for name, choices in (("occluders", OCCLUDERS), ("texture_sets", TEXTURE_SETS)):
            if getattr(self, name) not in choices:
                known = ", ".join(choices)
                raise OptionError(f"{name}: {getattr(self, name)} is not one of {known}")
        if not self.match_by_name:
            for name in ("high_suffix", "low_suffix", "occluders"):
                if getattr(self, name) != getattr(PartsOptions, name):
                    raise OptionError(
                        f"{name}: is for parts that are matched by their names; "
                        "ask for that too (match_by_name)"
                    )
            return
        if not self.high_suffix or not self.low_suffix:
            raise OptionError("high_suffix, low_suffix: neither may be empty; give such as _high")
        if self.high_suffix.lower() == self.low_suffix.lower():
            raise OptionError("high_suffix, low_suffix: both are the same; parts have to differ")
