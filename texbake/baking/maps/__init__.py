"""The table of all maps that a bake can make; the functions that compute them are loaded when used.

A map has the value of one hit, and the value where nothing was baked. Everything else (averaging
the samples of a texel, padding, coding, options, reports) follows from its row in the table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from texbake.errors import OptionError

if TYPE_CHECKING:
    from texbake.baking.hits import Hits
    from texbake.baking.inputs import BakeInputs
    from texbake.baking.maps.per_hit import Float32Array
    from texbake.baking.options import BakeOptions

OUTER, INNER = "outer rays", "inner rays"  # values of `MapKind.needs`
_FLAT = (0.0, 0.0, 1.0)
# Measured with 64 rays: 0.057 sqrt(v (1 - v)) of ao, for all v; 1.7 % of thickness.
_NOISE_OF_SHARES, _RELATIVE_NOISE = 1.3, 0.4


@cache
def _function(place: str) -> Callable[..., Any]:
    """Return a function of this package by its place, `MODULE.NAME`."""
    module, name = place.split(".")
    function: Callable[..., Any] = getattr(import_module(f"{__name__}.{module}"), name)
    return function


@dataclass(frozen=True)
class MapKind:
    """One kind of map."""

    name: str  # as in `BakeOptions.maps` and in file names
    channels: int
    # How values are encoded in files: `normal` (unit vectors), `height` (one signed length),
    # `vector` (signed lengths), `position` (points, relative to `BakeInputs.bounds`), `curvature`
    # (one over a length; signed, or one-sided where `mid` is 0), `thickness` (a length of 0 or
    # more), `color` (linear light; sRGB in 8 bits), `mask` (0 to 1, linear) or `id` (ids from 1 on,
    # 0 for none; a color per id in integer files).
    coding: str
    # `MODULE.NAME` of (hits, inputs) to (n, channels) float32: the value of each hit. The hits
    # include misses only where `of_misses` is set.
    function: str
    # The value of a texel with several hits: `mean`, `unit mean` (of unit vectors, normalized
    # again), or `first` (the first sample counts, as for ids).
    combine: str = "mean"
    # `hits`, or what else the map is made from: `outer rays` or `inner rays`, which start at the
    # hits. `Hits.secondary` exists only if one of the maps needs such rays.
    needs: str = "hits"
    # Whether it is a channel of the high-poly mesh's materials; its functions take the name first.
    is_channel: bool = False
    # Whether misses count among the values of a texel, so that one without any hit has a value.
    of_misses: bool = False
    # Whether a texel without any hit gets the colors around it instead of the neutral value.
    hides_misses: bool = False
    # Whether it also needs the neighbors of the faces that were hit, beyond their normals.
    of_neighbors: bool = False
    # Standard error of a texel's value v with one ray, as factors of sqrt(v (1 - v)) and of v. It
    # is divided by n^(3/4) for n rays.
    noise: tuple[float, float] = (0.0, 0.0)
    mid: float = 0.5  # level of 0 in integer files of `curvature`
    empty: float = 0.0  # each channel where nothing was baked, but for normals
    plain: tuple[float, ...] | None = None  # values that a surface has without the map
    legend_function: str = ""  # place of the function of `legend`; empty for none
    require_function: str = ""  # place of the function of `require`, called before any ray is cast

    def values(self, hits: Hits, inputs: BakeInputs) -> Float32Array:
        """(n, channels) float32: the value of each hit."""
        values: Float32Array = self._bound(self.function)(hits, inputs)
        return values

    def neutral(self, options: BakeOptions) -> tuple[float, ...]:
        """Return the value where nothing was baked."""
        if self.coding == "normal" and options.space == "tangent":
            return _FLAT
        return (self.empty,) * self.channels

    def legend(self, inputs: BakeInputs) -> tuple[str, ...]:
        """Return the names that the ids from 1 on have."""
        return self._bound(self.legend_function)(inputs) if self.legend_function else ()

    def require(self, inputs: BakeInputs) -> None:
        """Raise if the inputs lack what the map needs."""
        if self.require_function:
            self._bound(self.require_function)(inputs)

    def _bound(self, place: str) -> Callable[..., Any]:
        function = _function(place)
        return partial(function, self.name) if self.is_channel else function


def _channel(name: str, coding: str = "mask", empty: float = 0.0) -> MapKind:
    """Return the map of a channel of materials."""
    return MapKind(
        name,
        3 if coding == "color" else 1,
        coding,
        "channels.channel_values",
        is_channel=True,
        hides_misses=True,
        empty=empty,
        require_function="channels.require_channel",
    )


_KINDS = (
    MapKind("normal", 3, "normal", "normals.normal_values", combine="unit mean", plain=_FLAT),
    MapKind("displacement", 1, "height", "heights.displacement_values", plain=(0.0,)),
    MapKind("vector-displacement", 3, "vector", "heights.vector_displacement_values",
            plain=(0.0, 0.0, 0.0)),
    MapKind("position", 3, "position", "heights.position_values"),
    # The same map: the transform of a mesh file is applied when the file is read.
    MapKind("world-position", 3, "position", "heights.position_values"),
    MapKind("curvature", 1, "curvature", "surface.curvature_values", of_neighbors=True),
    MapKind("convexity", 1, "curvature", "surface.convexity_values", of_neighbors=True, mid=0.0),
    MapKind("concavity", 1, "curvature", "surface.concavity_values", of_neighbors=True, mid=0.0),
    MapKind("object-id", 1, "id", "surface.object_id_values", combine="first",
            legend_function="surface.object_names"),
    MapKind("material-id", 1, "id", "surface.material_id_values", combine="first",
            legend_function="surface.material_names"),
    MapKind("vertex-color", 3, "color", "surface.vertex_color_values", hides_misses=True,
            require_function="surface.require_colors"),
    _channel("base-color", "color"),
    _channel("alpha", empty=1.0),
    _channel("metallic"),
    _channel("roughness", empty=1.0),
    _channel("occlusion", empty=1.0),
    _channel("emissive", "color"),
    _channel("clearcoat"),
    _channel("clearcoat-roughness"),
    _channel("transmission"),
    _channel("sheen-color", "color"),
    _channel("sheen-roughness"),
    _channel("specular", empty=1.0),
    _channel("specular-color", "color"),
    MapKind("opacity", 1, "mask", "surface.opacity_values", of_misses=True, plain=(1.0,)),
    MapKind("ao", 1, "mask", "occlusion.ambient_occlusion_values", needs=OUTER,
            noise=(_NOISE_OF_SHARES, 0.0), empty=1.0, plain=(1.0,)),
    MapKind("bent-normal", 3, "normal", "occlusion.bent_normal_values", combine="unit mean",
            needs=OUTER, plain=_FLAT),
    MapKind("thickness", 1, "thickness", "occlusion.thickness_values", needs=INNER,
            noise=(0.0, _RELATIVE_NOISE)),
)  # fmt: skip
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
