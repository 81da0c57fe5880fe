"""Levels that the integer files of several maps share."""

import numpy as np
import pytest

from texbake.baking.codings import encode_map
from texbake.baking.maps import MAPS
from texbake.baking.options import BakeOptions
from texbake.baking.parts.result import with_common_levels
from texbake.baking.result import BakedMap


def baked(name, least, greatest, **given):
    """A map with values in a range, and values far out of it where nothing was hit."""
    kind = MAPS[name]
    values = np.random.default_rng(7).uniform(least, greatest, (8, 8, kind.channels))
    values[0, 0], values[0, 1] = least, greatest
    has_data = np.ones((8, 8), dtype=np.bool_)
    values[7], has_data[7] = 100.0, False
    return BakedMap(kind, values.astype(np.float32), has_data, BakeOptions(**given))


def levels(item, bits):
    return encode_map(item, bits).metadata


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(("name", "given"), [
    ("displacement", {}),
    ("displacement", {"mid": 0.25}),
    ("displacement", {"scale": 9.0}),
    ("vector-displacement", {}),
    ("curvature", {}),
    ("convexity", {"curvature_scale": 3.0}),
    ("thickness", {}),
    ("thickness", {"thickness_distance": 5.0}),
    ("ao", {}),
    ("normal", {}),
])  # fmt: skip
def test_levels_of_all_are_those_of_the_map_whose_values_have_the_widest_range(name, given, bits):
    least = 0.0 if name in ("thickness", "ao") else -1.0
    widest, other = baked(name, least, 2.0, **given), baked(name, 0.1 * least, 0.3, **given)
    empty = baked(name, least, 2.0, **given)
    empty.has_data[:] = False
    for maps in ([widest, other, empty], [empty, other, widest]):
        shared = with_common_levels(maps, bits)
        assert all(levels(item, bits) == levels(widest, bits) for item in shared)
        assert not any(encode_map(item, bits).n_clipped for item in shared)
    for alone in ([other], [empty, empty]):
        assert levels(with_common_levels(alone, bits)[0], bits) == levels(alone[0], bits)


@pytest.mark.parametrize("mid", [None, 0.5])
def test_heights_of_maps_apart_share_the_levels_of_one_map_with_all_of_them(mid):
    low, high = baked("displacement", -3.0, -1.0, mid=mid), baked("displacement", 1.0, 2.0, mid=mid)
    both = baked("displacement", -3.0, 2.0, mid=mid)
    for item in with_common_levels([low, high], 16):
        assert levels(item, 16) == levels(both, 16)
