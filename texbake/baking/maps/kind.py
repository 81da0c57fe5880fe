"""What a bake needs to know of a map: how its values are computed, combined, coded and checked."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.baking.hits import Hits
    from texbake.baking.inputs import BakeInputs
    from texbake.baking.options import BakeOptions
    from texbake.mesh.mesh import Float32Array

OUTER, INNER = "outer rays", "inner rays"  # values of `MapKind.needs`
FLAT = (0.0, 0.0, 1.0)


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
    # (hits, inputs) to (n, channels) float32: the value of each hit. The hits include misses only
    # where `of_misses` is set.
    function: Callable[..., Float32Array]
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
    plain: tuple[float, ...] | None = None  # value for which the map changes nothing
    legend_function: Callable[..., tuple[str, ...]] | None = None  # of `legend`; None: no ids
    require_function: Callable[..., None] | None = None  # of `require`, before any ray is cast

    def values(self, hits: Hits, inputs: BakeInputs) -> Float32Array:
        """(n, channels) float32: the value of each hit."""
        values: Float32Array = self._bound(self.function)(hits, inputs)
        return values

    def neutral(self, options: BakeOptions) -> tuple[float, ...]:
        """Return the value where nothing was baked."""
        if self.coding == "normal" and options.space == "tangent":
            return FLAT
        return (self.empty,) * self.channels

    def legend(self, inputs: BakeInputs) -> tuple[str, ...]:
        """Return the names that the ids from 1 on have."""
        return () if self.legend_function is None else self.legend_function(inputs)

    def require(self, inputs: BakeInputs) -> None:
        """Raise if the inputs lack what the map needs."""
        if self.require_function is not None:
            self._bound(self.require_function)(inputs)

    def _bound(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return partial(function, self.name) if self.is_channel else function
