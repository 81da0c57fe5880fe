"""Pictures in a given time; what a machine takes is not foretold here, but what is chosen is."""

import time
from dataclasses import replace

import pytest

from texbake.mesh.shapes import icosphere
from texbake.rendering import adaptive
from texbake.rendering.options import RenderOptions
from texbake.rendering.picture_report import PictureBudget
from texbake.rendering.render import render

OPTIONS = RenderOptions(width=64, height=48)


def test_much_time_gets_the_closest_bound():
    frame = render(icosphere(2), options=replace(OPTIONS, time_budget="10min"))
    assert frame.budget.choice == "max-error 0.5/255"
    assert frame.budget.why == "the closest bound of the ladder"
    assert [item.max_error for item in frame.budget.candidates] == [16, 8, 4, 2, 1, 0.5]
    assert frame.sampling.max_error == pytest.approx(0.5)
    assert not frame.budget.warnings
    assert 0 < frame.budget.probe_seconds < frame.budget.predicted_seconds
    assert frame.budget.probe_seconds < frame.budget.actual_seconds < 600


def test_a_bound_is_the_closest_that_time_is_spent_on():
    options = replace(OPTIONS, time_budget="10min", max_error="3/255")
    frame = render(icosphere(2), options=options)
    assert frame.budget.choice == "max-error 3/255"
    assert frame.sampling.max_error == pytest.approx(3.0)


def test_no_time_gets_the_first_samples_and_a_warning():
    frame = render(icosphere(2), options=replace(OPTIONS, time_budget="1ms"))
    assert frame.budget.choice == "16 samples of each pixel, shaded once"
    assert frame.budget.why == "because these left no time to look at any bound"
    assert frame.sampling.max_error is None and not frame.sampling.warnings
    assert "was not kept" in frame.budget.warnings[0]


def test_normals_are_part_of_what_is_predicted(monkeypatch):
    """They are shaded by themselves, which is over before a bound is chosen."""
    shaded_sums = adaptive.shaded_sums

    def slow(*args):
        time.sleep(0.5)
        return shaded_sums(*args)

    monkeypatch.setattr(adaptive, "shaded_sums", slow)
    options = replace(OPTIONS, time_budget="10min")
    frame = render(icosphere(2), options=options)
    assert frame.normals is not None
    assert 0.5 < frame.budget.probe_seconds < frame.budget.predicted_seconds


def test_what_is_told():
    budget = PictureBudget(2.0, "max-error 1/255", "because", 0.5, 1.75, 1.5)
    assert budget.table() == [
        ("time budget", "2 s: max-error 1/255, because"),
        ("time predicted", "1.75 s, 0.50 s of it up to the choice; took 1.50 s"),
    ]
