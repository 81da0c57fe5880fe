"""File names of maps, from a pattern such as `{asset}_{map}_{udim}.{ext}`."""

from __future__ import annotations

import re
import string
from collections.abc import Sequence

from texbake.errors import OptionError, quoted

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

    Examples
    --------
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
