"""Hits to maps: one module a map, and one list of them.

A map says how many channels it has, what stands where nothing was baked, and what value one hit
gives. Everything else (averaging a texel's samples, padding, files) is the same for all.
"""

from __future__ import annotations

from texbake.bake.map_names import MAP_NAMES
from texbake.bake.maps.displacement import DISPLACEMENT
from texbake.bake.maps.kind import MapKind
from texbake.bake.maps.normal import NORMAL
from texbake.bake.maps.vector_displacement import VECTOR_DISPLACEMENT
from texbake.errors import OptionError

MAPS: dict[str, MapKind] = {kind.name: kind for kind in (NORMAL, DISPLACEMENT, VECTOR_DISPLACEMENT)}


def map_kinds(names: tuple[str, ...]) -> list[MapKind]:
    """Look maps up by name; raise `OptionError` for a name that is not known."""
    for name in names:
        if name not in MAPS:
            raise OptionError(f"maps: {name} is not one of {', '.join(MAP_NAMES)}")
    return [MAPS[name] for name in dict.fromkeys(names)]
