"""Pictures in a given time: not how long a machine takes, but which bound is chosen."""

import time
from dataclasses import replace

from texbake.mesh.shapes import icosphere
from texbake.rendering.adaptive_pixels import samples
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render

OPTIONS = RenderOptions(width=64, height=48)


def test_much_time_gets_the_closest_bound():
    frame = render(icosphere(2), options=replace(OPTIONS, time_budget="10min"))
    assert frame.budget.choice == "`max_error=0.5/255`"
    assert frame.budget.why == "the closest bound of the ladder"
    assert [item.max_error for item in frame.budget.candidates] == [
        "16/255", "8/255", "4/255", "2/255", "1/255", "0.5/255",
    ]  # fmt: skip
    assert frame.sampling.max_error == "0.5/255"
    assert not frame.budget.warnings
    assert 0 < frame.budget.probe_seconds < frame.budget.predicted_seconds
    assert frame.budget.probe_seconds < frame.budget.actual_seconds < 600


def test_a_bound_is_the_closest_that_time_is_spent_on():
    options = replace(OPTIONS, time_budget="10min", max_error="3/255")
    frame = render(icosphere(2), options=options)
    assert frame.budget.choice == "`max_error=3/255`"
    assert frame.sampling.max_error == "3/255"


def test_no_time_gets_the_first_samples_and_a_warning():
    frame = render(icosphere(2), options=replace(OPTIONS, time_budget="1ms"))
    assert frame.budget.choice == "16 samples per pixel, each pixel shaded once"
    assert frame.budget.why == "because what comes first left no time to try any bound"
    assert frame.sampling.max_error is None and not frame.sampling.warnings
    assert "longer than its time budget" in frame.budget.warnings[0]


def test_normals_are_part_of_what_is_predicted(monkeypatch):
    """They are shaded separately, before a bound is chosen."""
    shaded_sums = samples.shaded_sums

    def slow(*args):
        time.sleep(0.5)
        return shaded_sums(*args)

    monkeypatch.setattr(samples, "shaded_sums", slow)
    options = replace(OPTIONS, time_budget="10min")
    frame = render(icosphere(2), options=options)
    assert frame.normals is not None
    assert 0.5 < frame.budget.probe_seconds < frame.budget.predicted_seconds
