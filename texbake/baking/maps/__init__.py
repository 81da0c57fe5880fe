"""Hits to maps: one module a map, and one list of them.

A map says how many channels it has, what stands where nothing was baked, and what value one hit
gives. Everything else (averaging a texel's samples, padding, files) is the same for all.
"""

from __future__ import annotations

from texbake.baking.map_names import MAP_NAMES
from texbake.baking.maps.ambient_occlusion import AMBIENT_OCCLUSION
from texbake.baking.maps.bent_normal import BENT_NORMAL
from texbake.baking.maps.curvature import CONCAVITY, CONVEXITY, CURVATURE
from texbake.baking.maps.displacement import DISPLACEMENT
from texbake.baking.maps.kind import MapKind
from texbake.baking.maps.material_id import MATERIAL_ID
from texbake.baking.maps.normal import NORMAL
from texbake.baking.maps.object_id import OBJECT_ID
from texbake.baking.maps.opacity import OPACITY
from texbake.baking.maps.position import POSITION, WORLD_POSITION
from texbake.baking.maps.texture import TEXTURE
from texbake.baking.maps.thickness import THICKNESS
from texbake.baking.maps.vector_displacement import VECTOR_DISPLACEMENT
from texbake.baking.maps.vertex_color import VERTEX_COLOR
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
    TEXTURE,
    OPACITY,
    AMBIENT_OCCLUSION,
    BENT_NORMAL,
    THICKNESS,
)
MAPS: dict[str, MapKind] = {kind.name: kind for kind in _KINDS}


def map_kinds(names: tuple[str, ...]) -> list[MapKind]:
    """Look maps up by name; raise `OptionError` for a name that is not known."""
    for name in names:
        if name not in MAPS:
            raise OptionError(f"maps: {name} is not one of {', '.join(MAP_NAMES)}")
    return [MAPS[name] for name in dict.fromkeys(names)]
