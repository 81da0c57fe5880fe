"""Savings at equal error, against measurements made by hand."""

import numpy as np
import pytest

from texbake.study.findings import findings, seconds_for, speedups
from texbake.study.knob import Evaluation, Knob, Setting
from texbake.study.result import KnobResult, Measurement


def result(baseline="fixed"):
    knob = Knob("k", "K", "about", "error", "°", "angle", lambda case: None, baseline)

    def item(label, series, seconds, error):
        return Measurement(Setting(label, label, series), Evaluation(error), (seconds,), None)

    items = (
        item("1", "fixed", 1.0, 8.0),
        item("4", "fixed", 4.0, 4.0),
        item("16", "fixed", 16.0, 1.0),
        item("64", "fixed", 64.0, 0.1),
        item("wide", "adaptive", 2.0, 4.0),
        item("close", "adaptive", 8.0, 0.25),
    )
    return KnobResult(knob, "on", "converged", "text", items)


def test_between_two_settings_error_falls_as_a_power_of_time():
    """From 4 to 1/4 in four times the time: an error of 1 lies half way, at twice the time."""
    found = {item.setting.setting.label: item for item in speedups(result())}
    assert list(found) == ["1", "4", "16"]  # nothing adaptive reaches 64 samples
    assert found["16"].share == pytest.approx(4.0 / 16.0)
    assert not found["16"].is_most
    assert (found["4"].share, found["4"].is_most) == (0.5, True)


def test_the_page_says_so_in_a_sentence():
    assert "“adaptive” reaches the 1° of “16” in 0.25 of its time (interpolated)." in findings(
        result()
    )
    assert speedups(result(baseline="")) == []


def test_slower_and_worse_points_change_nothing():
    rng = np.random.default_rng(0)
    for _ in range(50):
        front = [(2.0**k, 3.0**-k) for k in range(5)]
        beaten = [(s * rng.uniform(1, 9), e * rng.uniform(1, 9)) for s, e in front]
        error = 3.0 ** -rng.uniform(0.1, 3.9)
        expected = error ** (-np.log(2.0) / np.log(3.0))
        assert seconds_for(front + beaten, error) == pytest.approx(expected)
    assert seconds_for([(1.0, 0.0)], 0.0) == 1.0
    assert seconds_for([(1.0, 2.0)], 1.0) is None
