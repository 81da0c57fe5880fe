"""The clock of a time budget, and what its report says."""

import subprocess
import sys
import time

from texbake.sampling.rounds import BudgetClock, Round, TimeBudget, with_actual_time


def test_the_clock_of_the_process_began_before_python_did_anything():
    line = (
        "import time; time.sleep(0.3); from texbake.sampling.rounds import BudgetClock; "
        "print(BudgetClock.of_process().spent)"
    )
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-P", "-c", line], capture_output=True, text=True, check=True
    )
    # The system tells the start in hundredths of a second.
    assert 0.3 < float(done.stdout) < time.perf_counter() - start + 0.02


def test_a_clock_that_can_be_set_is_read_for_the_report():
    now = 5.0
    clock = BudgetClock(start=2.0, now=lambda: now)
    assert clock.spent == 3.0
    now = 6.5
    assert with_actual_time(budget(0.0), clock).actual_seconds == 4.5


def budget(actual, rounds=()):
    return TimeBudget(
        "the work", 2.0, "1deg", "the closest bound that fits", 1.0, 0.5, rounds, actual
    )


def test_a_time_that_was_exceeded_is_warned_of():
    assert budget(2.0).warnings == []
    assert budget(2.01).warnings == [
        "the work took 2.01 s with `max_error=1deg`, longer than its time budget of 2 s; use a "
        "smaller size"
    ]


def test_the_table_says_what_was_reached_and_how():
    rounds = (Round("4deg", 0.3, 0.25), Round("0.5deg", 0.5, 0.7, is_complete=False))
    assert budget(1.5, rounds).table() == [
        (
            "time budget",
            "2 s: the closest bound that fits; `max_error=1deg` gives the same bytes",
        ),
        (
            "time taken",
            "1.50 s, 0.50 s of it before the first samples; 4deg in 0.25 s, 0.5deg in 0.70 s "
            "(given up)",
        ),
    ]
