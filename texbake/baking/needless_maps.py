"""Maps that a model looks the same without: flat normals, no displacement, one color everywhere.

They are found when a bake is done, from its values. What is constant over all texels that were hit
needs no map: a flat normal map, heights of 0 and an open surface are what a material has anyway,
and one color or roughness is a factor of the material.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from texbake.baking.result import BakedMap
from texbake.texture.value_range import channel_ranges

# Values that a surface has without the map, by its name.
_PLAIN = {
    "normal": (0.0, 0.0, 1.0),
    "bent-normal": (0.0, 0.0, 1.0),
    "displacement": (0.0,),
    "vector-displacement": (0.0, 0.0, 0.0),
    "ao": (1.0,),
    "opacity": (1.0,),
}
_IN_TANGENT_SPACE = ("normal", "bent-normal")
# Half a step of 16 bits, of which normals and shares have about as many as that.
_ROUNDING = 0.5 / 65535.0


def needless_maps(maps: Mapping[str, BakedMap], size: float) -> Iterator[str]:
    """Yield a sentence for each map that changes nothing or could be a factor."""
    for name, item in maps.items():
        ranges = channel_ranges(item.values, item.has_data, threads=item.options.threads)
        if not np.isfinite(ranges).all():  # no texel has data
            continue
        rounding = size * _ROUNDING if item.kind.coding in ("height", "vector") else _ROUNDING
        plain = _PLAIN.get(name)
        if name in _IN_TANGENT_SPACE and item.options.space != "tangent":
            plain = None
        if plain is not None and float(np.abs(ranges.T - plain).max()) <= rounding:
            yield f"{name}: it is the same as no map at every texel; it can be left out"
        elif item.kind.coding in ("color", "mask") and plain is None and _are_constant(ranges):
            first = np.unravel_index(int(item.has_data.argmax()), item.has_data.shape)
            shown = ", ".join(f"{value:.4g}" for value in item.values[first])
            yield f"{name}: every texel is {shown}; a factor of the material says the same"


def _are_constant(ranges: npt.NDArray[np.float32]) -> bool:
    return bool((ranges[:, 1] - ranges[:, 0]).max() <= _ROUNDING)
