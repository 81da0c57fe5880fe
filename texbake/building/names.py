"""Names with places to fill in: `{asset}/{asset}_{output}.{ext}`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from texbake.errors import OptionError
from texbake.rendering.scene.file.faults import nearest

_PLACE = re.compile(r"\{([^{}]*)\}")


def filled(pattern: str, values: Mapping[str, str]) -> str:
    """Fill in the names in braces.

    >>> filled("{asset}_{output}.png", {"asset": "vase", "output": "normal"})
    'vase_normal.png'

    Raises
    ------
    OptionError
        A name in braces is not known, or a brace has no other.
    """
    if {"{", "}"} & set(_PLACE.sub("", pattern)):
        raise OptionError(f"{pattern!r} has a brace without its other; names are written {{name}}")

    def value(found: re.Match[str]) -> str:
        if found[1] not in values:
            raise OptionError(
                f"{pattern!r} has {found[0]}, which is not known; {nearest(found[1], values)}"
            )
        return values[found[1]]

    return _PLACE.sub(value, pattern)
