"""Bakes in a given time: what they give is what the reported bound gives."""

import time

import pytest

from tests.chosen_bounds import chosen_bounds
from texbake import BakeOptions, bake
from texbake.mesh.shapes import plane
from texbake.sampling.rounds import BudgetClock, Rounds


def bumpy():
    return plane(80, 80, lambda x, y: 0.05 * abs((9 * x) % 1 - 0.5) + 0.05 * abs((7 * y) % 1 - 0.5))


def assert_same(by_time, by_error):
    for name, baked in by_error.maps.items():
        assert by_time.maps[name].values.tobytes() == baked.values.tobytes(), name
    assert by_time.texel_faces.tobytes() == by_error.texel_faces.tobytes()
    assert by_time.report.sampling.sample_percents == by_error.report.sampling.sample_percents
    assert by_time.report.sampling.errors == by_error.report.sampling.errors


@pytest.mark.parametrize(("bounds", "give_up"), [
    ([4096.0], {}),
    ([4096.0, 64.0, 16.0, 5.0], {}),
    ([64.0, 3.0, 16.0], {1: 2}),
    ([256.0, 3.0, 2.0, 64.0, 12.0], {1: 1, 2: 3}),
    ([64.0, 16.0, 3.0], {2: 2}),
])  # fmt: skip
@pytest.mark.parametrize("maps", [("normal",), ("displacement", "normal", "object-id")])
def test_rounds_give_what_the_last_complete_bound_gives(monkeypatch, bounds, give_up, maps):
    same = {"size": 48, "maps": maps, "front": 0.1, "back": 0.1}
    with monkeypatch.context() as patched:
        chosen_bounds(patched, bounds, give_up)
        by_time = bake(bumpy(), plane(), BakeOptions(**same, time_budget=600))
    reached = by_time.report.budget.max_error
    complete = [one.max_error for one in by_time.report.budget.rounds if one.is_complete]
    assert reached == complete[-1]
    assert len(complete) == len(bounds) - len(give_up)
    assert_same(by_time, bake(bumpy(), plane(), BakeOptions(**same, max_error=reached)))


def test_samples_of_earlier_rounds_are_not_cast_again(monkeypatch):
    same = {"size": 48, "front": 0.1, "back": 0.1}
    with monkeypatch.context() as patched:
        chosen_bounds(patched, [256.0, 64.0, 64.0, 63.9])
        by_time = bake(bumpy(), plane(), BakeOptions(**same, time_budget=600)).report
    by_error = bake(bumpy(), plane(), BakeOptions(**same, max_error="0.256deg")).report
    # A texel that gets 16 samples at once may have had 4 before.
    assert by_error.counts.rays_cast <= by_time.counts.rays_cast < 1.2 * by_error.counts.rays_cast


def test_the_number_of_samples_of_a_round_is_predicted(monkeypatch):
    """Closely from the first samples, and roughly after a round of a wider bound."""
    same = {"size": 48, "front": 0.1, "back": 0.1}
    predicted = []
    with monkeypatch.context() as patched:
        chosen_bounds(patched, [4096.0, 256.0, 64.0])
        choose = Rounds._next

        def spy(self, work):
            n = len(work) - 1  # the widest bound is 2^16 times the closest
            predicted.append([work[8 * n // 16], work[6 * n // 16]])
            return choose(self, work)

        patched.setattr(Rounds, "_next", spy)
        bake(bumpy(), plane(), BakeOptions(**same, time_budget=600))
    wide, near = (
        bake(bumpy(), plane(), BakeOptions(**same, max_error=error)).report.counts.rays_cast
        for error in ("1.024deg", "0.256deg")
    )
    assert predicted[0] == pytest.approx([wide, near], rel=0.2)
    assert 0.25 < predicted[2][1] / (near - wide) < 4.0


def test_ample_time_reaches_the_given_error_and_ends():
    options = BakeOptions(size=64, time_budget=600, max_error="3deg", front=0.1, back=0.1)
    start = time.perf_counter()
    report = bake(bumpy(), plane(), options).report
    assert (report.budget.choice, report.sampling.max_error) == ("`max_error=3deg`", "3deg")
    assert report.budget.why == "the closest bound that is wanted"
    assert not report.measured and not report.warnings
    assert report.budget.actual_seconds < time.perf_counter() - start


def test_too_little_time_is_said_at_once_and_buys_the_fewest_samples():
    said = []
    report = bake(
        bumpy(), plane(), BakeOptions(size=64, time_budget="1ms"),
        clock=BudgetClock(warn=said.append),
    ).report  # fmt: skip
    (line,) = said
    assert line.startswith("time_budget: 0.001 s is too short: the bake takes about")
    assert report.budget.least_seconds < 10 * report.budget.actual_seconds
    assert report.sampling.max_error == report.budget.max_error
    assert report.counts.rays_cast < 1.5 * 64 * 64
    assert dict(report.table())["size"] == "64 x 64, adaptive samples"
    assert any("longer than its time budget of 0.001 s" in text for text in report.warnings)


def test_the_time_includes_what_went_before_and_what_follows():
    """The clock began two seconds ago, and writing the maps takes as many as there are rows."""
    calls = []

    def finish(maps):
        calls.append({name: baked.values.shape for name, baked in maps.items()})
        time.sleep(0.002 * len(maps["normal"].values))

    clock = BudgetClock(start=time.perf_counter() - 2.0, finish=finish)
    report = bake(
        bumpy(), plane(), BakeOptions(size=(32, 160), time_budget=2.5), clock=clock
    ).report
    assert calls == [{"normal": (16, 32, 3)}, {"normal": (128, 32, 3)}]
    assert report.budget.before_seconds > 2.0
    assert report.budget.least_seconds > 2.0 + 0.002 * 160


def test_a_share_of_a_mesh_without_extent_bounds_nothing():
    low = plane()
    low = low.replace(positions=0.0 * low.positions)
    options = BakeOptions(
        maps=("normal", "displacement"), samples="adaptive", size=4, padding=0, front=1.0, back=1.0
    )
    sampling = bake(plane(), low, options).report.sampling
    assert [summary.name for summary in sampling.errors] == ["normal"]
