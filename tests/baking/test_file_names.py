"""File names from patterns."""

import pytest

from texbake.baking.maps import DEFAULT_PATTERN, map_file_names
from texbake.errors import OptionError


def names(pattern, *maps, **changes):
    return map_file_names(
        pattern, **{"asset": "orc low", "maps": maps, "ext": "exr", "udim": 1012, **changes}
    )


def test_files_have_the_names_of_the_maps_by_default():
    assert names(DEFAULT_PATTERN, "normal", "ao") == {"normal": "normal.exr", "ao": "ao.exr"}


@pytest.mark.parametrize(
    ("pattern", "name"),
    [
        ("{asset}_{map}_{udim}.{ext}", "orc low_normal_1012.exr"),
        ("T_{asset}_{map}.{ext}", "T_orc low_normal.exr"),
        ("{{x}}{map}.{ext}", "{x}normal.exr"),
        ("{udim:05d}.{ext}", "01012.exr"),
    ],
)
def test_fields_are_replaced(pattern, name):
    assert names(pattern, "normal") == {"normal": name}


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("{mesh}.{ext}", r"\{mesh\} is not known"),
        ("{}.{ext}", "is not known"),
        ("{map.x}.{ext}", "is not known"),
        ("{map.{ext}", "cannot be parsed"),
        ("{map}.png", r"must end with \.\{ext\}"),
        ("{asset}/{map}.{ext}", "names a folder"),
        ("{asset}.{ext}", "two maps the same name"),
    ],
)
def test_wrong_patterns(pattern, message):
    with pytest.raises(OptionError, match=message):
        names(pattern, "normal", "ao")
