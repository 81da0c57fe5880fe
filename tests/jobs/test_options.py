"""Options that `run` passes on to its bake."""

import pytest

from texbake.errors import OptionError
from texbake.jobs.options import DEFAULT_SAMPLES, RunOptions


@pytest.mark.parametrize(
    ("choices", "expected"),
    [
        ({"samples": "adaptive"}, ("adaptive", None, None)),
        ({"samples": 64}, (64, None, None)),
        ({"max_error": "1deg"}, (1, "1deg", None)),
        ({"time_budget": "9s"}, (1, None, "9s")),
        ({}, (DEFAULT_SAMPLES, None, None)),
    ],
)
def test_samples_are_four_where_no_error_and_no_time_is_given(choices, expected):
    bake = RunOptions(**choices).bake_options()
    assert (bake.samples, bake.max_error, bake.time_budget) == expected
    assert bake.is_adaptive == (expected[0] == "adaptive" or expected[1] is not None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 4, "max_error": "1deg"}, "leave nothing to choose"),
        ({"samples": "some"}, "samples: some"),
        ({"max_error": "small"}, "is not an error"),
        ({"time_budget": "later"}, "is not a duration"),
        ({"size": 16, "padding": 8}, "padding: 8"),
        ({"convention": "vulkan"}, "convention: vulkan"),
        ({"up": "x"}, "up: x"),
        ({"base_color": (1.0, 2.0, 0.0)}, "base_color"),
    ],
)
def test_impossible_options_are_refused_before_the_work(options, message):
    with pytest.raises(OptionError, match=message):
        RunOptions(**options)
