"""Bounds on the errors of maps and of a picture."""

import math

import pytest

from texbake import OptionError, RenderOptions
from texbake.sampling.bounds import (
    BOUNDED_CODINGS,
    ErrorBounds,
    format_codes,
    parse_bounds,
    parse_picture_bound,
)


@pytest.mark.parametrize(
    ("text", "angle", "height"),
    [("0.5deg", 0.5, None), ("90deg", 90.0, None), ("60deg,2%", 60.0, 0.2),
     ("270deg, 0.125", 270.0, 0.125), ("0.5", None, 0.5), ("1e-3%", None, 1e-4)],
)  # fmt: skip
def test_bounds_of_maps_are_chords_and_lengths(text, angle, height):
    """The diagonal is 10; unit vectors at an angle a are 2 sin(a / 2) apart."""
    bounds = parse_bounds(text)
    assert {"normal", "height", "vector"} == set(BOUNDED_CODINGS)
    for factor in (1.0, 0.25, 3.0):
        scaled = bounds.scaled(factor)
        assert scaled.of_map("color", 10.0) is None
        if angle is None:
            assert scaled.of_map("normal", 10.0) is None
        else:
            half = math.radians(min(factor * angle, 180.0)) / 2.0
            assert scaled.of_map("normal", 10.0) == pytest.approx(2.0 * math.sin(half), rel=1e-12)
        for coding in ("height", "vector"):
            wanted = None if height is None else pytest.approx(factor * height, rel=1e-12)
            assert scaled.of_map(coding, 10.0) == wanted
        assert str(parse_bounds(str(scaled))) == str(scaled)


def test_bounds_are_written_as_they_are_read():
    assert str(ErrorBounds()) == ""
    assert str(ErrorBounds(math.radians(0.5), 0.25, 1e-4)) == "0.5deg,0.25,0.01%"
    assert [format_codes(n / 255) for n in (1, 2.5, 0.0625)] == ["1/255", "2.5/255", "0.0625/255"]


@pytest.mark.parametrize("text", ["", "0.5deg,", "deg", "-1deg", "0%", "inf", "nandeg", "1 mm"])
def test_what_is_no_bound_of_maps(text):
    with pytest.raises(OptionError, match=r"max_error: .* is not an error; give an angle"):
        parse_bounds(text)


@pytest.mark.parametrize("text", ["1deg,2deg", "0.1,0.2", "1%,2%", "0.1,1%", "1%,1deg,0.1"])
def test_two_bounds_of_one_kind(text):
    with pytest.raises(OptionError, match="has two bounds of one kind"):
        parse_bounds(text)


@pytest.mark.parametrize(
    ("value", "error"), [("2/255", 2 / 255), ("0.01", 0.01), (0.5, 0.5), (" 1 / 4 ", 0.25)]
)
def test_errors_are_shares_of_white(value, error):
    assert parse_picture_bound(value) == error
    assert RenderOptions(max_error=value).is_adaptive


@pytest.mark.parametrize("value", ["0", "-1/255", "2", "1/0", "small", "", "nan", "0.5deg", "1/"])
def test_what_is_not_an_error(value):
    with pytest.raises(OptionError, match=r"max_error: .* is not an error of a picture"):
        RenderOptions(max_error=value)


@pytest.mark.parametrize("options", [{"max_error": 0.01}, {"time_budget": "5s"}])
@pytest.mark.parametrize(("name", "value"), [("buffer", "depth"), ("interpolation", "scanline")])
def test_what_cannot_be_sampled_adaptively(options, name, value):
    with pytest.raises(OptionError, match=f"{name}, {next(iter(options))}: "):
        RenderOptions(**options, **{name: value})


def test_samples_are_fixed_by_default():
    assert not RenderOptions().is_adaptive


def test_memory_is_bounded():
    with pytest.raises(OptionError, match="max_error: 16384 x 16384 pixels are above 67108864"):
        RenderOptions(max_error=0.1, width=16384, height=16384, supersampling=1)
