"""Names of the files of maps, from a pattern such as `{asset}_{map}_{udim}.{ext}`."""

from __future__ import annotations

import re
import string
from collections.abc import Sequence

from texbake.errors import OptionError

DEFAULT_PATTERN = "{map}.{ext}"
FIRST_TILE = 1001
_FIELDS = ("asset", "map", "set", "udim", "ext")
# What file systems do not take in a name.
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
    """Names of the files of some maps.

    Parameters
    ----------
    pattern
        `{asset}`, `{map}`, `{set}`, `{udim}` and `{ext}` stand for what they say; anything else
        stays.
    asset
        What is baked.
    ext
        Suffix without the dot, which tells the format.
    udim
        Number of the tile.
    texture_set
        Of which faces; what files cannot be called becomes `_`. None: all of the asset.

    Returns
    -------
    dict of str to str
        Name of a map to the name of its file.

    Raises
    ------
    OptionError
        The pattern has another field, names a folder, has no `.{ext}` at its end, or gives two maps
        one name.

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
                f"name-pattern: {{{unknown[0]}}} is not known; use "
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
            f"name-pattern: {pattern!r} does not parse ({error}); write {DEFAULT_PATTERN}"
        ) from error
    if not pattern.endswith(".{ext}"):
        raise OptionError(f"name-pattern: {pattern!r} must end with .{{ext}}")
    if any("/" in name or "\\" in name for name in names.values()):
        raise OptionError(f"name-pattern: {pattern!r} names a folder; that is for -o to say")
    if len({name.lower() for name in names.values()}) < len(names):
        raise OptionError(f"name-pattern: {pattern!r} gives two maps one name; put {{map}} in it")
    return names
