"""Times as a person writes them."""

import pytest

from texbake.durations import parse_seconds
from texbake.errors import OptionError


@pytest.mark.parametrize(
    ("word", "seconds"),
    [
        ("20s", 20.0),
        ("500ms", 0.5),
        ("2min", 120.0),
        ("1h", 3600.0),
        (3, 3.0),
        (" 1.5 ", 1.5),
        (" 3 s", 3.0),
    ],
)
def test_units(word, seconds):
    assert parse_seconds(word) == seconds


@pytest.mark.parametrize("word", ["0s", "-1", "later", "", "inf", "nan", "s", "20 seconds", None])
def test_invalid_durations(word):
    with pytest.raises(OptionError, match=r"time_budget: .* is not a duration"):
        parse_seconds(word)
