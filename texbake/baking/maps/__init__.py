"""All maps that a bake can make: `MAPS`, in the order in which they are listed to users.

A module for each source of values declares its maps below the functions that compute them; NumPy
is imported only when they are called. Everything else (averaging the samples of a texel, padding,
coding, options, reports) follows from the declaration.
"""

from __future__ import annotations

from texbake.baking.maps import geometry, occlusion, surface
from texbake.baking.maps.kind import INNER, OUTER, MapKind
from texbake.errors import OptionError

__all__ = ["INNER", "MAPS", "MAP_NAMES", "MATERIAL_MAPS", "OUTER", "MapKind", "map_kinds"]

_KINDS = (*geometry.KINDS, *surface.KINDS, *occlusion.KINDS)
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
