"""Names of files from patterns."""

import pytest

from texbake.baking.file_names import DEFAULT_PATTERN, map_file_names
from texbake.errors import OptionError


def names(pattern, *maps, **changes):
    return map_file_names(
        pattern, **{"asset": "orc low", "maps": maps, "ext": "exr", "udim": 1012, **changes}
    )


def test_names_are_those_of_the_maps_if_nothing_else_is_asked():
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
def test_fields_stand_for_what_they_say(pattern, name):
    assert names(pattern, "normal") == {"normal": name}


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("{mesh}.{ext}", r"\{mesh\} is not known"),
        ("{}.{ext}", "is not known"),
        ("{map.x}.{ext}", "is not known"),
        ("{map.{ext}", "does not parse"),
        ("{map}.png", r"must end with \.\{ext\}"),
        ("{asset}/{map}.{ext}", "names a folder"),
        ("{asset}.{ext}", "two maps one name"),
    ],
)
def test_patterns_that_cannot_be_meant(pattern, message):
    with pytest.raises(OptionError, match=message):
        names(pattern, "normal", "ao")
