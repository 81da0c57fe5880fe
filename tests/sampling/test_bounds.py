"""Bounds on the error of a picture."""

import pytest

from texbake.errors import OptionError
from texbake.rendering.options import RenderOptions
from texbake.sampling.bounds import parse_picture_bound


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
