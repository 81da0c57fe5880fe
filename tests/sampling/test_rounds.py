"""Rounds of samples on a clock that is set by hand, and what their report says."""

import subprocess
import sys
import time

import numpy as np
import pytest

from texbake.sampling.rounds import (
    BudgetClock,
    OutOfTimeError,
    Round,
    Rounds,
    TimeBudget,
    spread_rows,
    with_actual_time,
)


class Work:
    """A `Refinable` whose error falls with the samples that are spent on it, at known costs."""

    def __init__(self, budget, *, unit=4e-5, growth=1.0, overhead=0.05, seed=0):
        rng = np.random.default_rng(seed)
        self.now, self.work, self.sampling, self.kept = 0.3, 0.0, 0.0, 0.0
        self.unit, self.growth, self.overhead = unit, growth, overhead
        self.starts = []
        # Errors in closest bounds, each of which costs four samples.
        self.errors = rng.lognormal(4.0, 2.0, 50_000).astype(np.float32)
        self.warnings = []
        clock = BudgetClock(start=0.0, now=lambda: self.now, warn=self.warnings.append)
        self.rounds = Rounds(budget, "the work", clock, (1.0, 1.0))

    def run(self):
        """Spend the time; return the report."""
        rounds = self.rounds
        self.now += self.unit * len(self.errors)
        n = float(len(self.errors))
        rounds.learn_first(unit=self.unit, total=n, overhead=self.overhead, after=0.2)
        report = rounds.run(self)
        self.now += rounds.after
        return report

    def name_of(self, bound):
        return f"{bound:.9g}"

    def refine(self, bound):
        self.starts.append(self.now)
        refined = self.errors > bound
        work = 4.0 * self.growth * np.count_nonzero(refined)
        # Most samples of rounds that were given up are those of a wider bound.
        work = max(work - 0.9 * self.kept, 0.0)
        for k in range(10):
            self.rounds.check((1.0 - 0.1 * k) * self.unit * work)
            self.now += 0.1 * self.unit * work
            self.work += 0.1 * work
            self.kept += 0.1 * work
            self.sampling += 0.1 * self.unit * work
        self.now += self.overhead
        self.errors[refined] = self.kept = 0.0

    def predicted_errors(self):
        return self.errors, np.full(len(self.errors), 4.0, dtype=np.float32)

    def work_done(self):
        return self.work, self.sampling


@pytest.mark.parametrize("growth", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("overhead", [0.01, 0.1])
@pytest.mark.parametrize("budget", [3.0, 5.0, 8.0])
def test_the_time_is_spent_and_not_exceeded(budget, overhead, growth):
    """Also where rounds cost half or twice of what is expected at first."""
    work = Work(budget, growth=growth, overhead=overhead)
    report = work.run()
    assert not work.warnings and work.now <= budget
    assert work.now > 0.85 * budget or report.max_error == "1"


def test_a_time_below_the_least_takes_the_least():
    work = Work(1.0)
    report = work.run()
    assert [one.is_complete for one in report.rounds] == [True]
    assert float(report.max_error) > 1000.0 and report.why == "the fewest samples"
    assert work.now == pytest.approx(2.55, abs=0.1)
    assert report.least_seconds == pytest.approx(2.55)


@pytest.mark.parametrize("budget", [1e-300, 0.01, 1e9, 1e300])
def test_extreme_times_end(budget):
    report = Work(budget).run()
    assert len(report.rounds) == 1
    assert (float(report.max_error) == 1.0) == (budget > 1.0)


def test_bounds_become_closer_from_round_to_round():
    report = Work(6.0).run()
    complete = [float(one.max_error) for one in report.rounds if one.is_complete]
    assert len(complete) > 1 and report.why == "the closest bound that fits"
    assert complete == sorted(complete, reverse=True)
    assert report.max_error == report.rounds[-1].max_error


def test_nothing_above_the_closest_bound_is_done_in_a_round():
    work = Work(1000.0)
    work.errors[:] = 0.5
    report = work.run()
    assert report.max_error == "1" and work.work == 0.0


def test_a_round_that_takes_too_long_is_given_up_and_a_wider_one_follows():
    work = Work(5.0, overhead=0.01)
    refine = work.refine

    def slower(bound):
        refine(bound)
        work.growth = 2.5

    work.refine = slower
    report = work.run()
    given_up = [float(one.max_error) for one in report.rounds if not one.is_complete]
    assert given_up and float(report.max_error) > min(given_up)
    assert work.now <= 5.0 + 0.1 * 2.5


def test_the_least_round_is_never_given_up():
    work = Work(0.5)
    work.rounds.check(100.0)
    report = work.run()
    assert [one.is_complete for one in report.rounds] == [True]
    work.rounds.check()


def test_a_first_round_that_takes_too_long_is_given_up_as_well():
    work = Work(4.0, growth=5.0)
    report = work.run()
    assert not report.rounds[0].is_complete
    assert report.max_error == report.rounds[-1].max_error
    assert report.why == "the closest bound that fits"
    assert work.now <= 4.0
    with pytest.raises(OutOfTimeError):
        work.rounds.check(1.0)


def test_too_short_a_time_is_said_once_and_at_once():
    work = Work(0.6)
    work.rounds.expect_at_least(0.65, margin=1.15)  # may be too long
    assert work.warnings == []
    work.rounds.expect_at_least(0.8)
    work.rounds.expect_at_least(0.9)
    assert work.warnings == [
        "time_budget: 0.6 s is too short: the work takes about 0.8 s even with the fewest "
        "samples, which it now uses"
    ]


@pytest.mark.parametrize("growth", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("overhead", [0.01, 0.1])
def test_more_time_never_gives_a_wider_bound(growth, overhead):
    """Not by the last percent, which depends on where rounds happen to end."""
    budgets = 2.5 * 1.2 ** np.arange(14)
    bounds = [
        float(Work(budget, growth=growth, overhead=overhead).run().max_error) for budget in budgets
    ]
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[0] > 1000.0 and bounds[-1] == 1.0


@pytest.mark.parametrize("overhead", [0.0005, 0.02])
@pytest.mark.parametrize("budget", [5.0, 8.0])
def test_no_round_begins_when_the_time_is_nearly_spent(budget, overhead):
    work = Work(budget, overhead=overhead, seed=3)
    work.run()
    assert len(work.starts) > 2
    assert max(work.starts) + work.rounds.after <= 0.92 * budget


@pytest.mark.parametrize(("budget", "overhead", "share"), [(6.0, 0.6, 0.87), (9.0, 1.2, 0.83)])
def test_a_round_after_which_no_other_pays_takes_most_of_what_is_left(budget, overhead, share):
    work = Work(budget, overhead=overhead)
    work.run()
    assert share * budget < work.now <= budget


@pytest.mark.parametrize("more", [10.0, 1000.0, 20_000.0])
def test_an_overhead_that_grows_with_all_samples_is_foreseen(more):
    """By most of what it grows, so that another round is not predicted to take far too little."""
    rounds, per_sample, unit = Work(1000.0).rounds, 4e-4, 1e-6
    rounds.unit, rounds.total = unit, 1000.0
    rounds._learn(100.0, 100.0, 1100.0 * per_sample + 100.0 * unit, 100.0 * unit)
    predicted = rounds.overhead + rounds.unit * more
    assert 0.65 < predicted / ((1100.0 + more) * per_sample + more * unit) <= 1.0


@pytest.mark.parametrize("factor", [0.01, 0.4, 0.6, 1.0, 1.8, 3.0, 100.0])
def test_one_round_changes_a_prediction_by_a_factor_of_two_at_most(factor):
    work = Work(1000.0, overhead=0.0)
    work.errors[:] = 8.0
    work.run()
    unit = work.rounds.unit
    work.rounds._learn(4.0, 100.0, 100.0 * factor * unit, 100.0 * factor * unit)
    assert work.rounds.unit == pytest.approx(min(max(factor, 0.5), 2.0) * unit)


@pytest.mark.parametrize("has_result", [False, True])
def test_a_round_is_given_up_when_it_and_what_follows_do_not_fit(has_result):
    """Half of its overhead is still to come; without a result, also a round that has one."""
    work = Work(10.0)
    rounds = work.rounds
    rounds.after, rounds.overhead, rounds._is_least = 1.0, 2.0, False
    rounds._reached = 4.0 if has_result else float("inf")
    last = 0.98 * 10.0 - 1.0 - (0.5 if has_result else 1.5) * 2.0
    for work.now, seconds in ((last - 0.01, 0.0), (1.0, last - 1.01)):
        rounds.check(seconds)
    for work.now, seconds in ((last + 0.01, 0.0), (1.0, last - 0.99)):
        with pytest.raises(OutOfTimeError):
            rounds.check(seconds)


@pytest.mark.parametrize(("n", "n_chosen", "n_runs"), [(1000, 16, 4), (17, 16, 8), (4000, 250, 8)])
def test_rows_are_spread_evenly(n, n_chosen, n_runs):
    runs = spread_rows(n, n_chosen, n_runs)
    assert {len(run) for run in runs} == {n_chosen // n_runs} and len(runs) == n_runs
    rows = np.concatenate(runs)
    assert len(np.unique(rows)) == len(rows) and rows.min() >= 0 and rows.max() < n
    middles = np.array([run.start + len(run) / 2 for run in runs])
    np.testing.assert_allclose(middles, (np.arange(n_runs) + 0.5) * n / n_runs, atol=1.0)
    assert list(np.concatenate(spread_rows(n_chosen, n_chosen, n_runs))) == list(range(n_chosen))


@pytest.mark.parametrize("overhead", [0.01, 0.1])
@pytest.mark.parametrize("budget", [4.0, 6.0, 9.0])
def test_a_round_is_predicted_to_take_its_share_of_the_time_that_is_left(budget, overhead):
    """0.4 of it for the first one, 0.7 for others, and 0.85 for the last."""
    work = Work(budget, overhead=overhead)
    report = work.run()
    shares = [
        one.predicted_seconds / (0.96 * budget - start - work.rounds.after)
        for one, start in zip(report.rounds, work.starts, strict=True)
    ]
    most = [0.4, *[0.7] * (len(shares) - 2), 0.85][: len(shares)]
    # A step between two bounds is a 64th of a doubling, and the closest bound takes what it takes.
    assert all(share <= limit + 1e-9 for share, limit in zip(shares, most, strict=True))
    assert all(share > limit - 0.1 for share, limit in zip(shares[:-1], most, strict=False))


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
        ("time budget", "2 s: the closest bound that fits; `max_error=1deg` gives the same bytes"),
        (
            "time taken",
            "1.50 s, 0.50 s of it before the first samples; 4deg in 0.25 s, 0.5deg in 0.70 s "
            "(given up)",
        ),
    ]
