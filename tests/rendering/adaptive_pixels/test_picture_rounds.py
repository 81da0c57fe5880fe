"""Pictures in a given time: what they show is what the reported bound gives."""

import time
from dataclasses import replace

import pytest

from tests.chosen_bounds import chosen_bounds
from tests.rendering.adaptive_pixels.test_sampler import a_scene
from texbake import RenderOptions, render, render_scene
from texbake.mesh.shapes import icosphere
from texbake.rendering.adaptive_pixels import samples
from texbake.sampling.rounds import BudgetClock

OPTIONS = RenderOptions(width=64, height=48)


@pytest.mark.parametrize(("bounds", "give_up"), [
    ([1e6], {}),
    ([1e6, 256.0, 64.0, 20.0], {}),
    ([256.0, 20.0, 64.0], {1: 2}),
    ([512.0, 32.0, 20.0, 256.0, 64.0], {1: 1, 2: 3}),
    ([256.0, 20.0], {1: 3}),
])  # fmt: skip
@pytest.mark.parametrize("name", ["opaque", "glass", "sky"])
def test_rounds_show_what_the_last_complete_bound_shows(monkeypatch, name, bounds, give_up):
    """Byte for byte, though pixels are then sampled in other windows and together with others."""
    with monkeypatch.context() as patched:
        chosen_bounds(patched, bounds, give_up)
        by_time = render_scene(a_scene(name), replace(OPTIONS, time_budget=600))
    complete = [one.max_error for one in by_time.budget.rounds if one.is_complete]
    assert by_time.budget.max_error == complete[-1]
    assert len(complete) == len(bounds) - len(give_up)
    by_error = render_scene(a_scene(name), replace(OPTIONS, max_error=complete[-1]))
    assert by_time.color.tobytes() == by_error.color.tobytes()
    assert by_time.coverage.tobytes() == by_error.coverage.tobytes()
    assert by_time.sampling.errors == by_error.sampling.errors
    assert by_time.sampling.sample_percents == by_error.sampling.sample_percents


def test_pixels_are_not_sampled_twice_in_the_same_way(monkeypatch):
    with monkeypatch.context() as patched:
        chosen_bounds(patched, [256.0, 64.0, 64.0, 63.9])
        by_time = render_scene(a_scene("opaque"), replace(OPTIONS, time_budget=600))
    by_error = render_scene(a_scene("opaque"), replace(OPTIONS, max_error=by_time.budget.max_error))
    one, other = by_time.sampling.shadings_per_pixel, by_error.sampling.shadings_per_pixel
    assert other <= one < 1.5 * other


def test_much_time_gets_the_bound_that_is_wanted():
    frame = render(icosphere(2), options=replace(OPTIONS, time_budget="10min"))
    assert frame.budget.choice == "`max_error=0.0625/255`"
    options = replace(OPTIONS, time_budget="10min", max_error="3/255")
    frame = render(icosphere(2), options=options)
    assert frame.budget.choice == "`max_error=3/255`"
    assert frame.budget.why == "the closest bound that is wanted"
    assert frame.sampling.max_error == "3/255"
    assert 0.0 < frame.budget.actual_seconds < 600.0 and not frame.budget.warnings


def test_too_little_time_is_said_at_once_and_buys_the_fewest_samples():
    said = []
    options = replace(OPTIONS, time_budget="1ms")
    frame = render(icosphere(2), options=options, clock=BudgetClock(warn=said.append))
    (line,) = said
    assert line.startswith("time_budget: 0.001 s is too short: the picture takes about")
    assert frame.budget.max_error == frame.sampling.max_error == "254/255"
    assert "longer than its time budget of 0.001 s" in frame.budget.warnings[0]


def test_a_picture_of_nothing_ends():
    scene = a_scene("opaque")
    empty = replace(scene, objects=(replace(scene.objects[0], visible=False),))
    frame = render_scene(empty, replace(OPTIONS, time_budget=1e9))
    assert not frame.coverage.any() and frame.budget.max_error == "0.0625/255"


def test_normals_and_what_follows_are_part_of_the_time(monkeypatch):
    """Normals are shaded before the first samples, and writing is timed with these."""
    shade, shapes = samples.shade_to_sums, []

    def slow(*args):
        time.sleep(0.5)
        return shade(*args)

    def finish(color):
        shapes.append(color.shape)
        time.sleep(0.2)

    monkeypatch.setattr(samples, "shade_to_sums", slow)
    options = replace(OPTIONS, time_budget="10min", max_error="16/255")
    frame = render(icosphere(2), options=options, clock=BudgetClock(finish=finish))
    assert frame.normals is not None and frame.budget.before_seconds > 0.5
    assert frame.budget.least_seconds > 0.7
    assert shapes == [(48, 64, 4)] * 2
