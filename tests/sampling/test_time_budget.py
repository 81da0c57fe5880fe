"""What a time budget reports, and which bounds fit into it."""

import time

import pytest

from texbake.sampling.time_budget import Candidate, TimeBudget, choose_bound, why_not


def budget(actual):
    return TimeBudget("the work", 2.0, "few", "why", 0.5, 1.75, actual)


@pytest.mark.parametrize(("predicted", "fits"), [(7.82, True), (7.83, False), (100.0, False)])
def test_a_bound_fits_with_a_margin_on_what_is_predicted(predicted, fits):
    """One second is spent; 9 / 1.15 = 7.826 are left."""
    reason = why_not(Candidate("1deg", predicted), spent=1.0, seconds=10.0)
    assert (reason is None) is fits
    if not fits:
        assert reason.startswith(f"because 1deg would take about {1.0 + predicted:.2f} s in all")


def choose(predictions, seconds, *, spent=0.0, tries_first=True):
    """Choose from a ladder of bounds whose predictions are given."""
    now = time.perf_counter()
    return choose_bound(
        list(predictions), lambda bound: Candidate(str(bound), predictions[bound]), seconds,
        start=now - spent, began=now - spent, tries_first=tries_first,
    )  # fmt: skip


def test_the_closest_bound_that_fits_is_chosen():
    choice = choose({8: 10.0, 4: 30.0, 2: 60.0, 1: 200.0, 0.5: 1.0}, 100.0)
    assert choice.bound == 2
    assert choice.predicted == 60.0
    # Nothing is tried beyond the first that does not fit.
    assert [candidate.max_error for candidate in choice.candidates] == ["8", "4", "2", "1"]
    assert choice.why.startswith("because 1 would take about 200.")


def test_an_ample_time_gets_the_last_bound():
    choice = choose({8: 1.0, 4: 2.0}, 100.0)
    assert choice.bound == 4
    assert choice.why == "the closest bound of the ladder"


def test_trying_ends_when_its_share_of_the_time_is_spent():
    assert len(choose({8: 1.0, 4: 1.0}, 100.0, spent=39.0).candidates) == 2
    choice = choose({8: 1.0, 4: 1.0}, 100.0, spent=41.0)
    assert choice.bound == 8
    assert choice.why == "because trying closer bounds would take too much of the time"
    choice = choose({8: 1.0, 4: 1.0}, 100.0, spent=41.0, tries_first=False)
    assert choice.bound is None
    assert choice.why == "because what comes first left no time to try any bound"


def test_a_time_that_was_exceeded_is_warned_of():
    assert budget(2.0).warnings == []
    assert budget(2.01).warnings == [
        "the work took 2.01 s with few, longer than its time budget of 2 s; use a smaller size"
    ]


def test_the_table_says_what_was_taken_and_why():
    assert budget(1.5).table() == [
        ("time budget", "2 s: few, why"),
        ("time predicted", "1.75 s, 0.50 s of it before the choice; took 1.50 s"),
    ]
