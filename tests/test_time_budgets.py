"""What is told of a time, and what fits into it."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from texbake.time_budgets import TimeBudget, why_not


@dataclass(frozen=True)
class Work(TimeBudget[str]):
    work: ClassVar[str] = "the work"
    first_part: ClassVar[str] = "at first"


@pytest.mark.parametrize(("predicted", "fits"), [(7.82, True), (7.83, False), (100.0, False)])
def test_a_choice_fits_with_a_margin_on_what_is_predicted(predicted, fits):
    """One second is spent; 9 / 1.15 = 7.826 are left."""
    found = why_not("1deg", spent=1.0, predicted=predicted, seconds=10.0)
    assert (found is None) is fits
    if not fits:
        assert found.startswith(f"because 1deg would take about {1.0 + predicted:.2f} s in all")


def test_a_time_that_was_not_kept_is_warned_of():
    assert Work(2.0, "few", "why", 0.5, 1.75, 2.0).warnings == []
    assert Work(2.0, "few", "why", 0.5, 1.75, 2.01).warnings == [
        "the time budget of 2 s was not kept, the work took 2.01 s with few; use a smaller --size"
    ]


def test_the_table_says_what_was_taken_and_why():
    assert Work(2.0, "few", "why", 0.5, 1.75, 1.5).table() == [
        ("time budget", "2 s: few, why"),
        ("time predicted", "1.75 s, 0.50 s of it at first; took 1.50 s"),
    ]
