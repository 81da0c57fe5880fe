"""Matching high-poly to low-poly parts by name, and the other options of a bake of many parts.

docs/how-to/parts.md has the rules. What may follow a suffix does not begin with a letter, because
modeling programs number copies: `body_high.001` belongs to `body`, and `body_highlight` does not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from texbake.errors import MeshError, OptionError
from texbake.records import dataclass
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


_IGNORED = re.compile(r"_ignore(?![^\W\d_])", re.IGNORECASE)
_NAMES_SHOWN = 5


@dataclass(frozen=True)
class Match:
    """One low-poly part and what it is baked from."""

    base: str  # what both names have in common, as spelled in the low-poly part
    low: int  # index of the low-poly part
    highs: tuple[int, ...]  # indices of the high-poly parts, in their order


@dataclass(frozen=True)
class Matching:
    """Which part is baked from which, and which parts are left over."""

    high_names: tuple[str, ...]
    low_names: tuple[str, ...]
    matches: tuple[Match, ...]  # in the order of the low-poly parts
    # high_left, low_left, high_ignored, low_ignored: indices of parts without a match, and of
    # ignored parts.
    high_left: tuple[int, ...] = ()
    low_left: tuple[int, ...] = ()
    high_ignored: tuple[int, ...] = ()
    low_ignored: tuple[int, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """A sentence for each group of parts that are left over."""
        sides = (
            ("high-poly", self.low_names, self.low_left, "not baked"),
            ("low-poly", self.high_names, self.high_left, "not used"),
        )
        return [
            f"{format_names([names[i] for i in left])}: no {other} part of that name, so {done}"
            for other, names, left, done in sides
            if left
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a low-poly part and its high-poly parts, and of what is left over, to print."""
        rows = [
            (
                self.low_names[match.low],
                "from " + ", ".join(self.high_names[i] for i in match.highs),
            )
            for match in self.matches
        ]
        for names, left, word in (
            (self.low_names, self.low_left, "low-poly part without a high-poly part: not baked"),
            (self.high_names, self.high_left, "high-poly part without a low-poly part: not used"),
            (self.low_names, self.low_ignored, "low-poly part, ignored"),
            (self.high_names, self.high_ignored, "high-poly part, ignored"),
        ):
            rows += [(names[i], word) for i in left]
        return rows

    def to_json(self) -> dict[str, Any]:
        """Return everything by name, for `json.dump`."""
        high, low = self.high_names, self.low_names
        return {
            "matches": [
                {"base": m.base, "low": low[m.low], "high": [high[i] for i in m.highs]}
                for m in self.matches
            ],
            "low_left_over": [low[i] for i in self.low_left],
            "high_left_over": [high[i] for i in self.high_left],
            "low_ignored": [low[i] for i in self.low_ignored],
            "high_ignored": [high[i] for i in self.high_ignored],
        }


def match_names(
    high_names: Sequence[str], low_names: Sequence[str], options: PartsOptions
) -> Matching:
    """Find the high-poly parts of each low-poly part."""
    low_bases = [base_of(name, options.low_suffix, exact=True) for name in low_names]
    high_bases = [base_of(name, options.high_suffix) for name in high_names]
    return _match_bases(high_names, low_names, high_bases, low_bases, options)


def pair_names(
    high_names: Sequence[str], low_names: Sequence[str], options: PartsOptions
) -> Matching | None:
    """Find the high-poly object of each low-poly object; None unless all names pair up.

    A name without a suffix counts as a whole, and `simplify` keeps names such as `crate_high`.

    >>> pair_names(["lid", "box_high"], ["box_low", "lid"], PartsOptions()).table()
    [('box_low', 'from box_high'), ('lid', 'from lid')]
    """
    high_bases = [base_of(name, options.high_suffix) or name for name in high_names]
    low_bases = [
        base_of(name, options.low_suffix, exact=True) or base_of(name, options.high_suffix) or name
        for name in low_names
    ]
    lows, highs = (
        [base.lower() for base, name in zip(bases, names, strict=True) if not _IGNORED.search(name)]
        for bases, names in ((low_bases, low_names), (high_bases, high_names))
    )
    if len(lows) < 2 or len(set(lows)) < len(lows) or set(lows) != set(highs):
        return None
    return _match_bases(high_names, low_names, high_bases, low_bases, options)


def _match_bases(
    high_names: Sequence[str],
    low_names: Sequence[str],
    high_bases: Sequence[str | None],
    low_bases: Sequence[str | None],
    options: PartsOptions,
) -> Matching:
    """Match parts whose names are equal without their suffixes, whatever their case."""
    low_ignored = tuple(i for i, name in enumerate(low_names) if _IGNORED.search(name))
    high_ignored = tuple(i for i, name in enumerate(high_names) if _IGNORED.search(name))
    sources: dict[str, list[int]] = {}
    for i, base in enumerate(high_bases):
        if base is not None and i not in high_ignored:
            sources.setdefault(base.lower(), []).append(i)
    matches: dict[str, Match] = {}
    for i, base in enumerate(low_bases):
        if base is None or i in low_ignored:
            continue
        key = base.lower()
        if key in matches:
            raise MeshError(
                f"{low_names[matches[key].low]}, {low_names[i]}: two low-poly parts have the same "
                "name; rename one of them, or add _ignore to its name"
            )
        if key in sources:
            matches[key] = Match(base, i, tuple(sources[key]))
    if not matches:
        raise MeshError(
            f"match_by_name: no low-poly part ({format_names(low_names)}) matches a high-poly part "
            f"({format_names(high_names)}); name them like body{options.low_suffix} and "
            f"body{options.high_suffix}"
        )
    used_low = {match.low for match in matches.values()}
    used_high = {i for match in matches.values() for i in match.highs}
    return Matching(
        tuple(high_names),
        tuple(low_names),
        tuple(sorted(matches.values(), key=lambda match: match.low)),
        _others(len(high_names), used_high | {*high_ignored}),
        _others(len(low_names), used_low | {*low_ignored}),
        high_ignored,
        low_ignored,
    )


def base_of(name: str, suffix: str, *, exact: bool = False) -> str | None:
    """Return the name before its last suffix, which no letter may follow, or with `exact` nothing.

    >>> base_of("Body_HIGH.001", "_high"), base_of("body_highlight", "_high")
    ('Body', None)
    """
    after = "" if exact else r"(?:[\W\d_].*)?"
    found = re.fullmatch(f"(.+){re.escape(suffix)}{after}", name, re.IGNORECASE | re.DOTALL)
    return None if found is None else found.group(1)


def format_names(names: Sequence[str]) -> str:
    """The first few of the names."""
    more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
    return ", ".join(names[:_NAMES_SHOWN]) + more


def _others(n: int, used: set[int]) -> tuple[int, ...]:
    return tuple(i for i in range(n) if i not in used)
