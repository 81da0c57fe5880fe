"""All maps that a bake can make: `MAPS`, in the order in which they are listed to users.

`of_hits` declares maps below the functions that compute them; NumPy is imported only when they are
called. Everything else (averaging the samples of a texel, padding, coding, options, reports)
follows from the declaration.

Their files have names from a pattern such as `{asset}_{map}_{udim}.{ext}`.
"""

from __future__ import annotations

import re
import string
from collections.abc import Sequence

from texbake.baking.maps import of_hits
from texbake.baking.maps.kind import MapKind as MapKind
from texbake.errors import OptionError, quoted

_KINDS = (*of_hits.KINDS, *of_hits.SURFACE_KINDS, *of_hits.RAY_KINDS)
MAPS: dict[str, MapKind] = {kind.name: kind for kind in _KINDS}
MAP_NAMES = tuple(MAPS)
# Maps made from the materials of the high-poly mesh.
MATERIAL_MAPS = tuple(kind.name for kind in _KINDS if kind.is_channel or kind.name == "material-id")


def map_kinds(names: tuple[str, ...]) -> list[MapKind]:
    """Return the maps of the given names; raise `OptionError` for an unknown name."""
    for name in names:
        if name not in MAPS:
            raise OptionError(f"maps: {name} is not one of {', '.join(MAP_NAMES)}")
    return [MAPS[name] for name in dict.fromkeys(names)]


DEFAULT_PATTERN = "{map}.{ext}"
FIRST_TILE = 1001
_FIELDS = ("asset", "map", "set", "udim", "ext")
# Characters that file systems do not allow in names.
_NOT_IN_NAMES = re.compile(r'[\x00-\x1f/\\:*?"<>|]')


def map_file_names(
    pattern: str,
    *,
    asset: str,
    maps: Sequence[str],
    ext: str,
    udim: int = FIRST_TILE,
    texture_set: str | None = None,
) -> dict[str, str]:
    """Return the file names of maps.

    >>> map_file_names("{asset}_{map}_{udim}.{ext}", asset="orc", maps=["normal"], ext="png")
    {'normal': 'orc_normal_1001.png'}
    """
    try:
        fields = {name for _, name, _, _ in string.Formatter().parse(pattern) if name is not None}
        unknown = sorted(fields - {*_FIELDS})
        if unknown:
            raise OptionError(
                f"name_pattern: {{{unknown[0]}}} is not known; use "
                + ", ".join(f"{{{name}}}" for name in _FIELDS)
            )
        of_set = asset if texture_set is None else _NOT_IN_NAMES.sub("_", texture_set)
        names = {
            name: pattern.format(asset=asset, map=name, set=of_set, udim=udim, ext=ext)
            for name in maps
        }
    except (ValueError, IndexError) as error:
        if isinstance(error, OptionError):
            raise
        raise OptionError(
            f"name_pattern: {quoted(pattern)} cannot be parsed ({error}); write {DEFAULT_PATTERN}"
        ) from error
    if not pattern.endswith(".{ext}"):
        raise OptionError(f"name_pattern: {quoted(pattern)} must end with .{{ext}}")
    if any("/" in name or "\\" in name for name in names.values()):
        raise OptionError(
            f"name_pattern: {quoted(pattern)} names a folder; give the names of files only"
        )
    if len({name.lower() for name in names.values()}) < len(names):
        raise OptionError(
            f"name_pattern: {quoted(pattern)} gives two maps the same name; add {{map}}"
        )
    return names
