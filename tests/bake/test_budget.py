"""What a time is turned into."""

import pytest

from texbake.bake.bake import bake
from texbake.bake.options import BakeOptions
from texbake.bake.targets import parse_seconds
from texbake.errors import OptionError
from texbake.mesh.shapes import plane


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("20s", 20), ("500ms", 0.5), ("2min", 120), ("1h", 3600), ("7", 7), (2.5, 2.5), (" 3 s", 3)],
)
def test_times_are_read(text, seconds):
    assert parse_seconds(text) == pytest.approx(seconds)


@pytest.mark.parametrize("text", ["", "s", "-1s", "0", "inf", "nan", "20 seconds", None])
def test_other_words_are_no_times(text):
    with pytest.raises(OptionError, match="time-budget"):
        parse_seconds(text)


def bumpy():
    return plane(80, 80, lambda x, y: 0.05 * abs((9 * x) % 1 - 0.5) + 0.05 * abs((7 * y) % 1 - 0.5))


def test_ample_time_buys_the_closest_bound():
    report = bake(bumpy(), plane(), BakeOptions(size=128, time_budget="10min")).report
    budget = report.budget
    assert budget.choice == "max-error 0.125deg,0.0025%"
    assert len(budget.candidates) == 7
    rays = [candidate.rays_per_texel for candidate in budget.candidates]
    assert rays == sorted(rays)
    assert report.sampling.max_error == "0.125deg,0.0025%"
    assert budget.probe_seconds < budget.actual_seconds < budget.seconds
    assert report.measured


def test_too_little_time_buys_one_sample():
    report = bake(bumpy(), plane(), BakeOptions(size=64, time_budget="1ms")).report
    assert report.budget.choice == "1 sample a texel"
    assert report.sampling is None
    assert report.counts.rays_cast == 64 * 64
    assert any("time budget" in warning for warning in report.warnings)


def test_the_error_asked_for_is_where_it_ends():
    options = BakeOptions(size=64, time_budget=600, max_error="3deg", front=0.1, back=0.1)
    report = bake(bumpy(), plane(), options).report
    assert report.budget.choice == "max-error 3deg"
    assert not report.measured


def test_the_map_is_that_of_the_settings_it_names():
    options = {"size": 64, "front": 0.1, "back": 0.1}
    by_time = bake(bumpy(), plane(), BakeOptions(**options, time_budget=600, max_error="2deg"))
    by_error = bake(bumpy(), plane(), BakeOptions(**options, max_error="2deg"))
    same = by_time.maps["normal"].values == by_error.maps["normal"].values
    assert same.all()
