"""One coding for all maps of a name, so that the tiles of an asset fit together.

Integer files hold heights, curvatures and thicknesses by a scale that is measured where it is not
given. Measured map by map it would differ from tile to tile, while the program that reads them
takes one for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from texbake.baking.baked_map import BakedMap
from texbake.baking.codings import usual_curvature
from texbake.texture.encoding import height_range


def with_common_levels(maps: Sequence[BakedMap], bits: int) -> list[BakedMap]:
    """Maps of one kind, for integer files of 8 or 16 bits, with levels that hold all of them.

    Others than heights, curvatures and thicknesses, and levels that were given, stay as they are.
    """
    if len(maps) < 2:
        return list(maps)
    options, coding = maps[0].options, maps[0].kind.coding
    if coding in ("height", "vector") and options.scale is None:
        ends = np.array([_ends(baked) for baked in maps])
        everywhere = np.ones(ends.shape, dtype=np.bool_)
        mid, scale = height_range(ends, everywhere, bits=bits, mid=options.mid)
        options = replace(options, mid=mid, scale=scale)
    elif coding == "curvature" and options.curvature_scale is None:
        options = replace(options, curvature_scale=max(map(usual_curvature, maps)))
    elif coding == "thickness" and options.thickness_distance is None:
        greatest = max(_ends(baked)[1] for baked in maps)
        options = replace(options, thickness_distance=greatest or 1.0)
    return [replace(baked, options=options) for baked in maps]


def _ends(baked: BakedMap) -> tuple[float, float]:
    """Least and greatest finite value with data; 0 without any."""
    values = baked.values[baked.covered & np.isfinite(baked.values)]
    return (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
