"""The settings that a time budget leads to."""

import pytest

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.mesh.shapes import plane


def bumpy():
    return plane(80, 80, lambda x, y: 0.05 * abs((9 * x) % 1 - 0.5) + 0.05 * abs((7 * y) % 1 - 0.5))


def test_ample_time_buys_the_closest_bound():
    report = bake(bumpy(), plane(), BakeOptions(size=128, time_budget="10min")).report
    budget = report.budget
    assert budget.choice == "`max_error=0.125deg,0.0025%`"
    assert len(budget.candidates) == 7
    rays = [candidate.rays_per_texel for candidate in budget.candidates]
    assert rays == sorted(rays)
    assert report.sampling.max_error == "0.125deg,0.0025%"
    assert dict(report.table())["size"] == "128 x 128, adaptive samples"
    assert budget.probe_seconds < budget.actual_seconds < budget.seconds
    assert report.measured


def test_too_little_time_buys_one_sample():
    report = bake(bumpy(), plane(), BakeOptions(size=64, time_budget="1ms")).report
    assert report.budget.choice == "1 sample per texel"
    # The probe counts towards the predicted time.
    total = float(report.budget.why.split("about ")[1].split(" s in all")[0])
    assert total == pytest.approx(report.budget.predicted_seconds, abs=0.05)
    assert report.sampling is None
    assert dict(report.table())["size"] == "64 x 64, 1 sample per texel"
    assert report.counts.rays_cast == 64 * 64
    assert any("time budget" in warning for warning in report.warnings)


def test_no_bound_is_closer_than_the_given_error():
    options = BakeOptions(size=64, time_budget=600, max_error="3deg", front=0.1, back=0.1)
    report = bake(bumpy(), plane(), options).report
    assert report.budget.choice == "`max_error=3deg`"
    assert not report.measured


def test_the_map_equals_that_of_the_reported_settings():
    options = {"size": 64, "front": 0.1, "back": 0.1}
    by_time = bake(bumpy(), plane(), BakeOptions(**options, time_budget=600, max_error="2deg"))
    by_error = bake(bumpy(), plane(), BakeOptions(**options, max_error="2deg"))
    same = by_time.maps["normal"].values == by_error.maps["normal"].values
    assert same.all()
