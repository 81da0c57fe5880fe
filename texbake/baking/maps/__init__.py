"""From hits to maps: the table of all maps, which are defined in one module per kind.

A map defines how many channels it has, the value of one hit, and the value where nothing was baked.
Everything else (averaging the samples of a texel, padding, files) is the same for all maps.
"""

from __future__ import annotations

import copyreg

from texbake.baking.map_names import MAP_NAMES
from texbake.baking.maps.channels import CHANNEL_MAPS
from texbake.baking.maps.heights import (
    DISPLACEMENT,
    POSITION,
    VECTOR_DISPLACEMENT,
    WORLD_POSITION,
)
from texbake.baking.maps.kind import MapKind
from texbake.baking.maps.normals import NORMAL
from texbake.baking.maps.occlusion import AMBIENT_OCCLUSION, BENT_NORMAL, THICKNESS
from texbake.baking.maps.surface import (
    CONCAVITY,
    CONVEXITY,
    CURVATURE,
    MATERIAL_ID,
    OBJECT_ID,
    OPACITY,
    VERTEX_COLOR,
)
from texbake.errors import OptionError

_KINDS = (
    NORMAL,
    DISPLACEMENT,
    VECTOR_DISPLACEMENT,
    POSITION,
    WORLD_POSITION,
    CURVATURE,
    CONVEXITY,
    CONCAVITY,
    OBJECT_ID,
    MATERIAL_ID,
    VERTEX_COLOR,
    *CHANNEL_MAPS,
    OPACITY,
    AMBIENT_OCCLUSION,
    BENT_NORMAL,
    THICKNESS,
)
MAPS: dict[str, MapKind] = {kind.name: kind for kind in _KINDS}


def _kind_of(name: str) -> MapKind:
    return MAPS[name]


# Kinds hold functions, so they are pickled by name: every process has the same table.
copyreg.pickle(MapKind, lambda kind: (_kind_of, (kind.name,)))


def map_kinds(names: tuple[str, ...]) -> list[MapKind]:
    """Return the maps of the given names; raise `OptionError` for an unknown name."""
    for name in names:
        if name not in MAPS:
            raise OptionError(f"maps: {name} is not one of {', '.join(MAP_NAMES)}")
    return [MAPS[name] for name in dict.fromkeys(names)]
