"""The dense mesh's vertex colors, interpolated in linear light."""

from __future__ import annotations

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.on_surface import between_corners
from texbake.baking.options import BakeOptions
from texbake.errors import MeshError


def vertex_color_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Linear color of each hit: (n, 3) float32."""
    return between_corners(hits, inputs.high_colors, inputs.high.faces, inputs.options.threads)


def black(_: BakeOptions) -> tuple[float, ...]:
    """Return no light."""
    return (0.0, 0.0, 0.0)


def _require_colors(inputs: BakeInputs) -> None:
    if inputs.high.colors is None:
        raise MeshError(
            f"{inputs.high.name}: it has no vertex colors to carry over; leave the map "
            "vertex-color out, or give a dense mesh that has them"
        )


VERTEX_COLOR = MapKind(
    "vertex-color", 3, "color", vertex_color_values, black, require=_require_colors
)
